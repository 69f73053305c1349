"""Front end: what a function writes while it is traced."""

"""Front end: translates functions to code while they are traced."""

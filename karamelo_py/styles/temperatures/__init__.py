"""Temperature of a material. One style a file, named as in the script."""

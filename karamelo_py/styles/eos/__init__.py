"""Equations of state: pressure from volume. One style a file, named as in the script."""

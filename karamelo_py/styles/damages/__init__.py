"""Damage: how strength is lost. One style a file, named as in the script."""

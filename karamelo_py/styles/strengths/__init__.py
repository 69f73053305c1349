"""Strengths: deviatoric stress from strain. One style a file, named as in the script."""

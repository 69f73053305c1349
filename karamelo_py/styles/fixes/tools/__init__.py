"""Walls and rigid tools that push points."""

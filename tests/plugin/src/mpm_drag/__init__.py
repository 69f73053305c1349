"""Drag on material points: an example of a plug-in of karamelo-py."""

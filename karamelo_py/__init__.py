"""karamelo-py: the material point method, driven by Karamelo's script language."""

__version__ = "0.1.0"

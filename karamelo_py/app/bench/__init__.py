"""karamelo-py bench: speed of this machine."""

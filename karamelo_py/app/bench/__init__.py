"""karamelo-py bench: speed of this machine on known scenes."""

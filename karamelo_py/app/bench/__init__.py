"""karamelo-py bench: known scenes, and how fast this machine runs them."""

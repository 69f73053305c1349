"""python -m comparisons.bench: known scenes, and how fast this machine runs them."""

import os

# As the program does; NumPy reads it when it is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

"""What Numba compiles, listened to."""

from numba.core import event


class Compiled(event.Listener):
    """The names of the functions that Numba compiles."""

    def __init__(self):
        self.names = []

    def on_start(self, event):
        self.names.append(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event):
        """Nothing more."""

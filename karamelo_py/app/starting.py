"""While the program begins, Python does not look for what it could throw away.

Its search for cycles of objects went through all modules again and again, and once more at the
end: a third of what a small scene takes. What a program consists of stays to its end.
"""

import gc

_beginning = False


def begin() -> None:
    """Look for nothing from now on; for a process that is this program and nothing else."""
    global _beginning
    _beginning = True
    gc.disable()


def begun() -> None:
    """Look again, among what is new, where `begin` was called."""
    global _beginning
    if _beginning:
        _beginning = False
        gc.freeze()
        gc.enable()

"""karamelo-py: the material point method, driven by Karamelo's script language."""

from importlib import import_module

__version__ = "0.1.0"
__all__ = ["KarameloWarning", "Simulation", "SimulationError"]


def __getattr__(name):
    """Import what is for programs only when one asks for it: the command line starts faster."""
    if name in __all__:
        return getattr(import_module("karamelo_py.app.simulation"), name)
    raise AttributeError(f"module 'karamelo_py' has no attribute '{name}'")

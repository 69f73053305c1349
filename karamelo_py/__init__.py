"""karamelo-py: the material point method, driven by Karamelo's script language."""

from importlib import import_module

__version__ = "0.1.0"
__all__ = ["KarameloWarning", "Simulation", "SimulationError", "read_rows"]


def __getattr__(name):
    """Import the Python interface only on request: the command line starts faster."""
    if name in __all__:
        home = "plot" if name == "read_rows" else "simulation"
        return getattr(import_module(f"karamelo_py.app.{home}"), name)
    raise AttributeError(f"module 'karamelo_py' has no attribute '{name}'")

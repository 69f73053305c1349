"""Configuration of the documentation: python -m sphinx -W -b html docs docs/_build/html"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
# The tree is documented, whatever is installed.
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]

from karamelo_py import __version__  # noqa: E402  (only now is it found)

project = "karamelo-py"
author = "the authors of karamelo-py"
release = version = __version__
copyright = author

extensions = ["myst_parser", "reference_pages", "script_lexer"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_ext"]

html_theme = "furo"
html_title = f"karamelo-py {release}"
html_static_path = ["_static"]

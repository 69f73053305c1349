"""Configuration of the documentation: python -m sphinx -W -b html docs docs/_build/html"""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "karamelo-py"
author = "the authors of karamelo-py"
release = version = version_of("karamelo-py")
copyright = author

extensions = ["myst_parser", "reference_pages", "script_lexer"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_ext"]

html_theme = "furo"
html_title = f"karamelo-py {release}"
html_static_path = ["_static"]

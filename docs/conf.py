"""Configuration of the documentation: python -m sphinx -W -b html docs docs/_build/html"""

import sys
from pathlib import Path

from numpy import cos, pi

HERE = Path(__file__).parent
# The tree is documented, whatever is installed.
sys.path[:0] = [str(HERE.parent), str(HERE), str(HERE / "_ext")]

from karamelo_py import __version__  # noqa: E402  (only now is it found)

project = "karamelo-py"
author = "the authors of karamelo-py"
release = version = __version__
copyright = author

extensions = [
    "myst_nb",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
    "reference_pages",
    "gallery",
    "messages",
    "choose",
    "script_lexer",
    "source_links",
    "synonyms",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "amsmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_ext"]

# Each build runs the tutorials, in a temporary folder, and fails if one of them does.
nb_execution_in_temp = True
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True

# Words of the program stay as they are written: --threads, "text".
smartquotes = False

html_theme = "furo"
html_title = f"karamelo-py {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "_ext" / "scorer.js")
copybutton_exclude = ".linenos, .gp, .go"


def draw_reference_step(app):
    """Run the reference step; the page shows the picture."""
    import matplotlib
    from reference_step import vibrating_bar

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    times, shares = vibrating_bar()
    figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
    axes.plot(times, cos(10 * pi * times), "k-", lw=1, label="exact")
    axes.plot(times, shares, ".", ms=3, label="reference step")
    axes.set(xlabel="time (s)", ylabel="share of the first mode (1)")
    axes.legend()
    figure.savefig(HERE / "reference" / "generated" / "reference-step.svg")
    plt.close(figure)


def setup(app):
    """After the pages of the reference, which empty their folder first."""
    app.connect("builder-inited", draw_reference_step, priority=900)

"""The start of the program."""

import sys

from karamelo_py.app.leaving import leaving_at_once
from karamelo_py.app.starting import begin


def main() -> int:
    """Run the command line; returns the exit status."""
    begin()
    with leaving_at_once():
        from karamelo_py.app.cli import main as command
    return command()


if __name__ == "__main__":
    sys.exit(main())

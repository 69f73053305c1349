"""The scenes of inputs/ beside the numbers that others found.

A scene is a script inputs/in.NAME and, if there is something to compare, a file NAME.py here. It
has

- a docstring, whose first line says what is compared with whom;
- ``SMALL``, the variables that make a scene small enough for the tests, or None where others test
  it;
- ``compare(run, axes, full)``, which calls ``run(**variables)`` (a `Result`) once or more often. It
  draws its result beside the reference on Matplotlib axes, and yields a `Row` for each number.

``python -m comparisons`` runs them all at full size; with ``--write`` it writes the table and the
pictures of the documentation. The tests run them small and ask each row whether it agrees.
"""

"""Live pages in a browser, for a study, a run, or dumps.

Pages are served to this machine only, at an address with a secret word. docs/live-measurements.md
compares them with trame and Rerun.
"""

"""Live pages in a browser, for a study, a run, or dumps.

They are served to this machine only, at an address with a secret word. docs/live-measurements.md
compares with trame and Rerun.
"""

"""Live pages in a browser, for a study, a run, or a folder of dumps.

Pages are served to this machine only, at an address that contains a secret word.
docs/live-measurements.md compares them with trame and Rerun.
"""

"""Live pages in a browser: for a study, a run, or dumps written by another run.

A page is served to this machine only, at an address with a secret word. It reads files, or copies
at an output: runs are unchanged. Points are drawn with WebGL, curves and charts with Plotly,
without a network. docs/live-measurements.md compares with trame and Rerun.
"""

"""Live pages in a browser: for a study, a run, or dumps written by another run.

A page is served to this machine only, at an address with a secret word. It reads what is written,
or copies at an output, so runs are unchanged, and without a page there is no cost. Points are drawn
with WebGL, curves and charts with Plotly, as on pages of karamelo-py chart; no network is needed.
docs/live-measurements.md compares with trame and Rerun.
"""

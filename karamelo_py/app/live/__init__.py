"""Pages in a browser that follow what goes on: a study, a run, dumps that another run writes.

A page is served to this machine alone, at an address that holds a secret word. It reads what is
written, or a copy at an output: what runs does not change, and costs nothing where nobody asks.
The browser's own WebGL draws points, Plotly curves and charts, as on the pages of karamelo-py
chart; both work without a network. docs/live-measurements.md compares with trame and Rerun.
"""

"""Pages in a browser that follow what goes on: a study, a run, dumps that another run writes.

A page is served to this machine alone, at an address that holds a secret word. It reads what is
written, or a copy at an output: what runs does not change, and costs nothing where nobody asks.
Plotly draws, as on the pages of karamelo-py chart: one library for points (WebGL), curves and
charts, which works without a network and has 10 MB. Of others that were weighed by what they bring
along, trame needs VTK (140 MB) and a web server of its own, Rerun 170 MB and a viewer.
"""

"""Why a run went as it did, as facts; their words are in `maurice_viz/text/`.

- `explanation`: why one reference is believed, and where another one loses
- `failures`: why a run went wrong: its verdict and causes
- `second_opinion`: a filter of its own that doubts a run, without the truth
- `tour`: the steps to look at, in order; `budget`: which part of a filter costs how much accuracy
"""

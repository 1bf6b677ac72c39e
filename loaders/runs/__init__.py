"""Saved runs (docs/saved-runs.md).

* `writer`: records as table rows, written while the filter runs
* `checks`: one rule for every column of a saved run, applied as it is read
* `store`: runs read back and compared; `manifest`: what a run was made from, and how far it got
* `failures`: the failures of a run, in its manifest
"""

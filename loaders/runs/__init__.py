"""Saved runs (docs/saved-runs.md).

* `writer`: records as table rows, written while the filter runs
* `checks`: one rule for every column of a saved run, applied as it is read
* `store`: runs read back and compared
* `manifest`: what a run was made from, how far it got, and its failures
"""

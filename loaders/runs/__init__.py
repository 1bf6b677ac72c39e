"""Saved runs (docs/saved-runs.md).

* `writer`: records as table rows, written while the filter runs; `store`: read back and compared
* `manifest`: what a run was made from, and how far it got; `bookmarks`: steps by name
"""

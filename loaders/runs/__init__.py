"""Saved runs (docs/saved-runs.md).

* `writer`: written while the filter runs; `store`: read back and compared
* `manifest`, `sources`: what a run was made from; `rows`: records as table rows; `bookmarks`: steps by name
"""

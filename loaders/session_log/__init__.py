"""The session log, our own format (docs/session-log.md).

* `header`: the first line; `records`: the other lines, and true poses at the pictures' times
* `reader`: sessions and surveys; `writer`: written line by line
"""

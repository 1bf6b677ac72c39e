"""The session log, our own format (docs/session-log.md): one like those in `formats`, which we also write.

* `header`: the first line; `records`: the other lines as records of `reading.recording`
* `reader`: a log as a recording, and the pictures of a survey; `writer`: written line by line

What is done with records once they are read belongs to `reading`.
"""

"""The viewer's process, and the ways into it. What is shown is none of its business: `panels`, `layouts`.

open_viewers  starting viewers, and moving their time cursor
sinks         where a recording goes: a file, a viewer, or a file and every viewer that connects
blocks        recordings that nobody follows, written in blocks of many steps
snapshot      pictures of the viewer without a screen
movie         movies made of them
web           a page for browsers
"""

"""From what a user names to runs that are filtered, scored, saved and drawn. The commands are in `app`.

The walk of a replay, from the command to a dot on the screen:

1. `cli/replay.py` parses the command line and calls `app/replay.py`, as a program of Python would.
2. `source.py` tells once what the source is and holds all that is asked for, `filters.py` what filter;
   `open.py` opens session and library and builds a filter.
3. `playback.py` (of the package) steps all filters through the session; `run.py` goes through these
   steps: it scores each, saves it (`saving.py`), and has it drawn.
4. `output.py` opens a file, a viewer or a browser's page to draw to (`viewer/`), laid out by `layouts/`.
5. `observer.py` gives each step to the panels of its run, in the order of `panels/registry.py`.
6. A panel, such as that of the cloud in `panels/belief.py`, logs rows: `style.py` scales meters to the
   screen, `entities.py` says under which path they stand and on which timeline, `drawing/arrow.py` makes
   Arrow data of them.

Beside them: `live.py` listens to a live source for runs, `watch.py` says what changes meanwhile, `drive.py`
draws drives alone, `recorded.py` has another localizer's runs from bags, `drive_check.py` asks whether a
drive's pictures agree with the library, `saving.py` writes runs while they go, `saved_steps.py` restores the
steps of saved runs, `verify.py` filters a saved run again. Nothing here prints, and nothing here decides how
something looks or what words say.
"""

"""From what a user names to runs that are filtered, scored, saved and drawn. The commands are in `app`.

`open` and `run_spec` prepare session, library and filters; `output` says where is drawn; `run` goes through
the updates; `drive` draws a drive that no filter of ours runs on; `saved` and `saved_steps` keep runs and
restore them.
"""

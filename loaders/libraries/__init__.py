"""Libraries of reference pictures.

* `store`: built from a survey, opened, cached; `files`: the folder on disk
* `survey`: a survey log, or a selection of a drive's pictures
"""

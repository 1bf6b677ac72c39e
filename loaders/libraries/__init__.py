"""Libraries of reference pictures.

* `store`: built from a survey, opened, cached; `files`: the folder on disk
* `survey`: a survey log, or a selection of a drive's pictures
* `landmarks`, `keypoints`: found in a library's pictures
* `own_channels`: measured by channels of a user's own; `completed`: all that filters compare by
* `remembered`, `measured`: what was computed from files, and descriptors of pictures, in the user's cache
"""

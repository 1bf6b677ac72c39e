"""Files and their contents, before anybody asks what they mean: no format of a recording belongs here.

* `text`: text files, TOML, tables, checks of values; `pictures`: image files
* `maps`: walls from a ROS map or from a file of segments
* `writing`: atomic writes, and what `--force` may replace
"""

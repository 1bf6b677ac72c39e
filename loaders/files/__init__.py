"""Files and their contents, before anybody asks what they mean: no format of a recording belongs here.

* `text`, `yaml_text`: text files, TOML, YAML, tables, checks of values; `pictures`: image files
* `maps`: walls or an occupancy grid from a ROS map, walls from a file of segments; `ros_maps`: what ROS has
* `paths`: what a file or folder is that is no recording, and which one a mistyped path meant
* `writing`: atomic writes, and what `--force` may replace
"""

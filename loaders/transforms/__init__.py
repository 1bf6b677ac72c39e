"""Recordings around recordings, and the alignment of pictures in time.

* `corrected`: units, signs, frames and clocks corrected; `made_odometry`: odometry made from the truth
* `placeholders`: gray pictures for a drive without a camera; `gating`: fewer pictures
* `time_alignment`: pictures with odometry and truth; `clocks`: units of time, offsets between clocks
* `simplified_path`: a path of any length with few poses
"""

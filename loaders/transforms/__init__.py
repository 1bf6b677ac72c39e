"""Recordings around recordings, and the alignment of pictures in time.

* `corrected`: units, signs, frames and clocks corrected; `made_odometry`: odometry made from the truth
* `gating`: which pictures are used, gray pictures for a drive without a camera, long paths with few poses
* `time_alignment`: pictures with odometry and truth; `clocks`: units of time, offsets between clocks
"""

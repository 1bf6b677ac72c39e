"""From a recording of any format to a session, as a stream.

* `options`: how a recording is read; `recording`: records in time order, which every format is read into
* `transforms`: recordings corrected, with odometry made, with fewer pictures
* `jumps`: jumps of odometry; `plane`: the plane of the motion
* `time_alignment`: clocks, and pictures paired with odometry and truth by time
* `observations`: what makes the moments: pictures, or a laser's scans
* `session`: a recording as a session
"""

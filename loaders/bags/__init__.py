"""Bags and MCAP files: ROS 1, ROS 2 and Foxglove recordings.

- `recording`: a bag as a recording, with its camera, and how each kind is recognized
- `source`: the common interface, errors, bytes to messages; `containers`, `unpacking`: the files
- `messages`: the contents of messages: times, poses, clouds, coordinate frames, pictures; `video`
- `topics`: which topics are pictures, odometry and truth; `readers`: messages to records, in time order
- `twist`: odometry whose poses never move while its speeds do
- `scans`: a laser's scans, and where it sits on the robot; `maps`: the bag's map
- `localizer`: another localizer's particles in a bag
"""

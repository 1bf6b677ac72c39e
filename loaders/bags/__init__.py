"""Bags and MCAP files: ROS 1, ROS 2 and Foxglove recordings.

- `formats`: how each kind is recognized and opened
- `source`: the common interface, and the one place that converts errors of the libraries
- `ros1`, `ros2`, `mcap`: the containers, through `rosbags` and `mcap`
- `decoding`: bytes to messages: CDR, ROS 1, JSON, protobuf
- `messages`: the contents of messages: times, poses, clouds, coordinate frames
- `images`, `video`: pictures as RGB
- `topics`: which topics are pictures, odometry and truth
- `readers`: messages to records, in time order
- `recording`: a bag as a recording, with its camera
- `localizer`: another localizer's particles in a bag, and the bag's map
"""

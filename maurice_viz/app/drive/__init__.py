"""The simulated robot, driven by keys.

drive      a drive from its first picture to the end of the keys
desk       the robot, the filter that follows it, and what every key does to both
"""

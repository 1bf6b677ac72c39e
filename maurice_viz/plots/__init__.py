"""Figures for print, without the viewer.

calibration  the thesis's figures of odometry calibration and camera noise
sheets       a map of a library's ambiguity, and a sheet of a world's views
"""

"""Figures for print, without the viewer. Those of the thesis that need runs are in `benchmarks/thesis/`.

calibration  the thesis's figures of odometry calibration and camera noise
retrieval    how often a drive's pictures find the right reference
sheets       a map of a library's ambiguity, and a sheet of a world's views
"""

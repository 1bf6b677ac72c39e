"""Monte Carlo localization against a library of pictures: what was believed, and why.

This package knows numpy, OpenCV and scipy, never a viewer, and never prints.
"""

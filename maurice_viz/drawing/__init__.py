"""Drawings that panels log: pixel images and the arrays behind charts. No panel and no run is known here.

raster         short texts on pixel images, and their encoding
canvas         the ground of a map: floors, obstacles, ruler
keys           legends, as strips above a map or beside a plot
contact_sheet  the five best references as one picture
bars           bar charts of descriptors
arrow          arrays for Rerun without a Python loop
"""

"""Drawings that panels log: pixel images and the arrays behind charts. No panel and no run is known here.

What is logged under an entity path, or reads a step's record, is a panel's.

canvas         texts on pixel images, their encoding, and the ground of a map: floors, obstacles, ruler
keys           legends, as strips above a map or beside a plot
contact_sheet  pictures and captions of references, such as the five best; cards of one over its edges
arrow          rows as ready-made Arrow arrays, which Rerun takes unchanged
indexed        small drawings of palette colors, for what is drawn at every step
heat           heat maps of two-dimensional histograms
histogram_row  histograms of a picture and of a reference, all channels of a run in a grid
scan           a laser's scan from above, by itself and on the map
reference_chart  what a reference loses, by channel and element
"""

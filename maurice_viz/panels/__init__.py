"""What is drawn of a run: one class a panel, beside the views in which layouts show it, with their titles.

panel        what a panel is, and what it is given: the run before its first update, then each update
registry     the list of all panels of a run
observer     draws a run update by update: a list of panels, and how much of each update is drawn
views        kinds of views: maps, pictures, bar charts, plots, and the window

world        the map with its walls, its library nodes and its keys
belief       the cloud, the close-up, the estimate and the truth
population   the cloud's headings, its modes, and the ancestors of its survivors
camera       the picture and its edges
references   match circles, the five best references, likelihood maps
histograms   the picture's descriptors over its best match's
traces       one number per update, over the session
events       what each step did in words, and events as lanes
explanation  why the best reference wins, at every update
story        the verdict, and the errors with their limits
comparison   what several runs share
"""

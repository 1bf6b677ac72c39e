"""What is drawn of a run: one class a panel, beside the views in which layouts show it, with their titles.

Here is decided what is logged, when and where. Not here: where views stand (`layouts`), how a picture or a
chart is painted (`drawing`), what sentences say (`text`), and anything that is computed of a run (`mcl`).

panel        what a panel is: it gets a run and its scene (`scene.py`), then each update
registry     the list of all panels of a run
views        kinds of views: maps, pictures, bar charts, plots, and the window

world        the map with its walls, its library nodes and its keys
belief       the cloud, the close-up, the estimate and the truth
inside       the cloud before and after each phase of an update, and the strip of phases
population   the cloud's headings, its modes, its ancestors, and its weights as bars
camera       the picture and its edges, and the picture taken nearest to where a run is
references   match circles, the five best references, likelihood maps
traces       one number per update, over the session
events       what each step did in words, and events as lanes
explanation  why the best reference wins, at every update
story        the verdict, and the errors with their limits
sensors      what pose sensors show
laser/       a laser's scan by itself and on the map, and why a pose fits it
comparison/  what several runs share
drive        a drive by itself, without a filter
"""

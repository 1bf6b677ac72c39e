"""Where panels stand on a screen of 1600 x 1000, by name.

registry       all layouts of a recording, as tabs of one blueprint
names          their names, for the command line
overview       one run at a glance
inside_a_step  one update from the inside
explain        why the best reference wins, at every update or for one at full size
compare        two to four runs side by side
traces         one number per update, over the session
recorded       another localizer's recorded clouds
drive          a drive by itself
"""

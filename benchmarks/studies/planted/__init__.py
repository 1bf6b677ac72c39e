"""Drives on which a filter gets lost for a known reason: with these, what names the reason can be judged.

* `places`: worlds and libraries, and which seeds may be tuned on
* `drives`: simulated drives, and what can be done to one that was driven already
* `ways`: for each kind of cause the ways in which it is planted
* `harm`: whether a planted cause did harm; only then is the run a failure
* `planting`: from kind and seed to a planted run
"""

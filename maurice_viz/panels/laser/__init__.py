"""What a laser is shown by: its scan from above, where a run thinks that it was taken, and why.

scan         the scan by itself, and on the map around the estimate
explanation  the scan at the estimate and at the truth, beam by beam
"""

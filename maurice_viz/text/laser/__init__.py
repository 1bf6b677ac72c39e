"""What people read about the scans of a laser.

scan    how many beams of a scan agree with the map at a pose, and how the others do not
causes  why a robot with a laser was lost, and what its owner can do
"""

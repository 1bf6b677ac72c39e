"""A planar laser on an occupancy grid, as a pose sensor.

- `parameters`: which model of the laser, and its constants, by AMCL's names
- `reading`: the beams of a scan that are compared with the map
- `field`: what a beam that ends in a cell is worth, and the sum over beams for many poses at once
- `rays`: how far beams reach on the map
- `models`: the nats of a scan at many poses: our model, and those of AMCL
- `beluga`: those of Beluga
- `fit`: how a scan fits the map at the truth, at an estimate, and with the laser mounted otherwise
- `beams`: each beam judged at one pose (agrees, short, beyond, unknown, miss), and what is shown of that
- `matching`: where on a map one scan was taken: all poses searched, from coarse to fine
- `odometry`: how the robot moved between scans, by the scans
- `history`: whether earlier scans fit a place, too
- `sensor`: the pose sensor `Laser`
"""

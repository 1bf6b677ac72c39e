"""The sensor model: from a picture to the likelihood of every reference, and so of every particle.

Nothing here moves, weighs or resamples particles, which is the work of `filter`.

- `descriptors`: what is measured in a picture, the channels
- `distances`: how far a picture's descriptor is from every reference's
- `references`: which references a particle is compared with, and which poses none speaks for
- `map_places`: a map as a library, for robots without a camera
- `virtual_references`: what a picture taken midway between surveyed ones would measure
- `model`: fusion of the channels' distances, its log-likelihood with its floor, and all of these together
- `ahead`: pictures measured and compared ahead of the filter, on a thread of their own
- `outside`: pose sensors of other packages, loaded by name
- `verification`: the references that fit best, compared again by keypoints
- `landmarks`: points of the library's pictures whose place in space is known, a pose sensor of its own
- `laser`: a planar laser on an occupancy grid, another pose sensor
"""

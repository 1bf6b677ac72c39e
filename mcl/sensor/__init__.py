"""The sensor model: from a picture to the likelihood of every reference, and so of every particle.

- `descriptors`: what is measured in a picture, one file per channel (`color` is the color histogram)
- `distances`: how far a picture's descriptor is from every reference's
- `fusion`: several channels' distances to one
- `likelihood`: from a fused distance to a log-likelihood
- `features`: named sets of channels, with weights and calibrated scales
- `references`: which references a particle is compared with: lookup, interpolation, virtual references
- `model`: all of these together
"""

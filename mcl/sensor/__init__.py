"""The sensor model: from a picture to the likelihood of every reference, and so of every particle.

- `descriptors`: what is measured in a picture, one file per channel (`color` is the color histogram)
- `distances`: how far a picture's descriptor is from every reference's
- `likelihood`: fusion of several channels' distances to one, and from that to a log-likelihood
- `references`: which references a particle is compared with: lookup, interpolation, virtual references
- `model`: all of these together
"""

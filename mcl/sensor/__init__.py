"""The sensor model: from a picture to the likelihood of every reference, and so of every particle.

- `descriptors`: what is measured in a picture, one file per channel (`color` is the color histogram)
- `distances`: how far a picture's descriptor is from every reference's
- `references`: which references a particle is compared with: lookup, interpolation, virtual references
- `model`: fusion of the channels' distances to one, its log-likelihood, and all of these together
"""

"""The configuration of a filter.

- `parameters`: every choice as plain values, presets, a rule per key, layers, and keys of earlier versions
- `build`: from parameters to a localizer; `make_localizer`
"""

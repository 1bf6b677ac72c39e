"""The configuration of a filter.

- `parameters`: every choice as plain values, and presets, which are complete filters by name
- `schema`: one rule per key, layers of configuration, and the keys of earlier versions
- `build`: from parameters to a localizer; `make_localizer`
"""

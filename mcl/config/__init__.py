"""The configuration of a filter.

- `parameters`: everything that can be chosen, as plain values
- `schema`: one rule per key, layers of configuration, and the keys of earlier versions
- `presets`: whole filters by name
- `build`: from parameters to a localizer; `make_localizer`
"""

"""The configuration of a filter: plain values, checked, and the localizer they describe.

The fields of a part of the filter, with their rules, stand beside that part.

- `parameters`: every choice as plain values, presets, and layers that are merged
- `build`: from parameters to a localizer; `make_localizer`
"""

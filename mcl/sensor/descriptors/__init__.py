"""Channels: what is measured in a picture. One file per channel.

- `channel`: what every channel does, and the CMUcam2's histogram
- `registry`: all channels by name, `CHANNELS`; named sets of them with weights, `FEATURES`
- colors of the whole picture: `color`, `smoothed`, `blurred`, `cumulative`, `chromaticity`
- colors by place in the picture: `color_grid`, `tiny`
- edges: `edges`, `hog`
"""

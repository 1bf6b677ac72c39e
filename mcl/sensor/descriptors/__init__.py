"""Channels: what is measured in a picture. One file per channel; those of the CMUcam2's histogram share one.

- `registry`: what every channel does; all by name, `CHANNELS`; named sets of them with weights, `FEATURES`
- `histograms`: `color`, `edges`, `smoothed`, `blurred`, `cumulative`
- `chromaticity`: colors of the whole picture without its brightness
- colors by place in the picture: `color_grid`, `tiny`; edges: `hog`
- `network`: an ONNX file of the user's
"""

"""Landmarks: points of a library's pictures whose place in space is known, as a sensor of their own.

- `features`: keypoints of a picture
- `camera`: where points fall in a picture, for many poses at once
- `matching`: which keypoints of which references show the same thing
- `bundle`: where these things are, and what camera and poses make all views agree
- `normal_equations`: the least squares of that, solved without the points
- `calibration`: the camera, fitted from the library itself
- `records`: from where each landmark was seen, and from where it could have been
- `building`: all of these, from a library to its landmarks
- `landmark_set`: landmarks as plain values, and as arrays for a file
- `things`: which obstacle of the map each landmark is on, and what moved
- `planar`: where a robot in the plane must be to see matched landmarks where it does
- `picture`: what people are shown: what agrees, what disagrees, what moved
- `sensor`: the pose sensor `Landmarks`
"""

"""What the simulated robot sees.

- `camera`: rays through the world to a picture; `light`: how bright every surface is
- `image_sensor`: noise, gain and the camera's colors; `camera_session`: pictures of drives and surveys
- `laser`: what a planar laser sees, and the map that it would make
- `conditions`: light that changes during a session; `people`: who stands in view
"""

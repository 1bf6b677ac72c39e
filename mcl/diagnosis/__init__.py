"""What is wrong with a recording, as codes and numbers; `maurice_viz.text.diagnosis` puts them into words.

- `findings`: a recording as plain arrays, and the findings about it
- `plausibility`: whether times and numbers can be what they are called, without truth or pictures
- `odometry`: readings of the odometry, compared with the truth; `mast`: of which place on the robot that is
- `pictures`: where the camera looks and when, by truth and a library
"""

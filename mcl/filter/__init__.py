"""The particle filter, in the textbook's order. It reads no file, and knows neither truth nor scores.

- `localizer`: the step: propose, measure, weight, estimate, resample, recover; and a run over a session
- `batch_step`: many runs with different seeds, stepped as one array
- `branch`: the state in which another filter goes on from a step
- `motion`: motion models and motion outliers
- `guided_motion`: movements drawn toward where a sensor puts the robot, and weighted for it
- `past`: the updates before, as pose sensors ask for them
- `sensor_proposal`: poses that sensors propose, and which of them the cloud tracks
- `proposal`: initialization, pose sampling, and the mixture proposal
- `resampling`: schemes, policies, roughening, adaptive size (KLD)
- `recovery`: strategies that help a lost filter, and the particles that they draw
- `estimate`: one pose for each of many clouds, their modes, and the evidence of a picture
"""

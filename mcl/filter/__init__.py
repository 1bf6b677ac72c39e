"""The particle filter, in the textbook's order. It reads no file, and knows neither truth nor scores.

- `localizer`: the step: propose, measure, weight, estimate, resample, recover; and a run over a session
- `batch_step`: many runs with different seeds, stepped as one array
- `branch`: the state in which another filter goes on from a step
- `motion`: motion models and motion outliers
- `proposal`: where particles are drawn: at the start, by the motion model, or some by the mixture proposal
- `following`: the proposal of filters whose particles follow what sensors measure and propose
- `weighting`: weights by a picture, and what it says of the cloud
- `resampling`: schemes, policies, roughening, adaptive size (KLD)
- `recovery`: strategies that help a lost filter, and the particles that they draw
- `estimate`: one pose for each of many clouds, their modes, and the evidence of a picture
"""

"""Why a run went as it did, as facts. Scores are in `scoring`, words in `maurice_viz/text/`.

- `explanation`: why one reference is believed, and where another one loses
- `causes`: the one table of causes of failures, and of the incidents that belong to them: what befell the
  robot or its camera during a drive
- `evidence`, `surroundings`: the few numbers of each step, how far movements are from the model's, what the
  library says of a place, and one episode with its evidence
- `rules`: the one table of rules that judge it; they are in `drive_rules`, `picture_rules`, `laser_rules`,
  and `suspicion` for runs without truth; `diagnosis`: one cause for each time a run was lost; `rivals`: what
  another run over the drive tells of it
- `verdict`: what happened to a run, and the step to look at; `tour`: the steps to look at, in order
- `place`: whether the picture of an update knows the place, and whether dots are there
- `second_opinion`: a filter of its own that doubts a run, without the truth
- `budget`: which part of a filter costs how much accuracy
"""

"""What the public functions do: a file for each command, named after it.

A function here takes plain arguments, opens what they name by `running/`, computes, and returns values with
names; what it writes is named by `to` or by an argument of its own. It knows no console and no typed option
(`cli/` does), draws nothing itself (`panels/`, `layouts/`, `plots/` and `reports/` do), and composes no
sentence that a person reads (`text/` does).

replay, compare        runs of a filter; live sources
drive/                 the simulated robot driven by keys, live
diagnose, explain      why a run was lost; why a step came out as it did
what_if, remedies      a saved run branched with a change; what would have helped. branch: where and how
check/                 demands on many runs, for CI
trials                 filters tried with many seeds; budget: which part of a filter costs most accuracy
inspect                what a recording holds, what is wrong with it (`doctor`), which formats there are;
                       what happened in a saved run (`events`)
convert                recordings as logs or MCAP; saved runs for other tools (`export`)
snapshot               pictures and movies of the viewer
library, library_check building and tuning a library; how well it tells its places apart
calibrate              the motion and the noise of a robot; whether clouds hold the truth
"""

"""Commands that explain a run or a recording: explain, events, snapshot, report, jump, inspect, doctor."""

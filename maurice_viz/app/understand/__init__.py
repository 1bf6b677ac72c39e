"""Answers about a recording or a run: inspect, doctor, explain, snapshot."""

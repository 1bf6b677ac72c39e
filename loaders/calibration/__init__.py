"""Recordings that calibration measures: `trials` of movements, and `covered_pictures`."""

"""Commands that make data and parameters: simulate, survey, calibrate."""

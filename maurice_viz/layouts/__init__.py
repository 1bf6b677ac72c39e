"""Layouts: where everything stands on a screen of 1600 x 1000, by name."""

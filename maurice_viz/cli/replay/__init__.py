"""Commands that run filters: replay, compare, demo, verify."""

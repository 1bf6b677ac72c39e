"""Looking: the command line and the Rerun drawings."""

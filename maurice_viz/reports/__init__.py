"""The report: one page about a saved run that stands alone."""

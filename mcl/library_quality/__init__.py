"""library_quality."""

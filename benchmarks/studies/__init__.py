"""Claims about accuracy and judgments, measured: `python -m benchmarks.studies.NAME`; see README.md."""

"""Figures and claims of the thesis, from trials: `python -m benchmarks.thesis DIR -o OUT`; see README.md."""

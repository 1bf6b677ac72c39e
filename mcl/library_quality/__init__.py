"""How good a library is, before any run.

- `coverage`: how much of the free space it covers, in which directions, and where the gaps are
- `self_similarity`: how well it distinguishes its own places
"""

"""The formats that can be read: one file a format, and `registry`, which detects them.

Text formats share `_tables` (rows, columns, units) and `_poses` (poses in space, lists of pictures).
To add a format, write a module with a tuple `FORMATS`, and name it in `MODULES` of `registry`.
"""

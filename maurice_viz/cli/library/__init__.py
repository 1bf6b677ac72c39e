"""The commands `library build`, `show`, `tune` and `check`."""

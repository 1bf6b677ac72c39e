"""Files in, sessions out: the session log, libraries on disk, imports."""

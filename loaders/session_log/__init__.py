"""session_log."""

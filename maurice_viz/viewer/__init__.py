"""The viewer: starting it, sinks of recordings, tabs, its cursor, snapshots and movies without a screen."""

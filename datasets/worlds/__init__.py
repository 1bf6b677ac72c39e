"""World files that ship: TOML, described in docs/worlds.md."""

"""The command line: `app` lists the commands, one file holds those of a group; `shared/` serves them all."""

"""The command line: `app` lists the commands, one file holds those of a group, `options` their options."""

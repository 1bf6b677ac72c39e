"""The command line: `app` lists the commands, a file holds those of a group; `shared/` serves them all.

A command parses its options, calls one public function, and prints what that returns as a table or as JSON.
Nothing is computed here, and nothing outside this folder prints or exits. `main` starts the program;
`importer` is the command that Rerun itself calls.
"""

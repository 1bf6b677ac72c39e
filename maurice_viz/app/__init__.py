"""What the public functions do, without a console: a file for each command, named after it."""

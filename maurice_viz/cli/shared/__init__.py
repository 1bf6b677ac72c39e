"""What all commands share: options, output on the console, errors in one line."""

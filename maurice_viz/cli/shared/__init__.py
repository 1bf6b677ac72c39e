"""What all commands share: options and sets of them, typed values, the console, errors in one line."""

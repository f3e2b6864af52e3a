"""What command line and Python share: a function for each command, and what it gives."""

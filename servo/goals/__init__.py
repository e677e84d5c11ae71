"""Where the goal of a picture comes from: one source a file."""

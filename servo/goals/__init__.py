"""Sources of the desired sight of each picture, one a file."""

"""Files that commands write: folders, tables, plots, recordings, and their versions."""

"""What commands write: folders, tables, plots, recordings, and the versions they were made with."""

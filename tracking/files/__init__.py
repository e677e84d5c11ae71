"""Writing of files (each complete or absent, never through a link) and of CSV and JSON texts."""

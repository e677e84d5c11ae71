"""Writing of files, completely or not at all and never through links, and of CSV and JSON texts."""

"""Reading of files that a user names: only regular files, up to a limit of size."""

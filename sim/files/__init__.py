"""Reading files that a user names: only regular ones, up to a size, never by what they claim."""

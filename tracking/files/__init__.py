"""Reading and writing files: completely or not at all, of limited size, and not through links."""

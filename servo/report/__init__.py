"""Result folders as one HTML page: `servobench report`."""

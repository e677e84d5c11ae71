"""Result folders as one page that opens anywhere: `servobench report`."""

"""The HTML report that `servobench report` writes about folders of results."""

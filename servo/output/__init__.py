"""The files that commands write: folders, tables, plots, films, logs and recordings, with format
numbers and package versions; and the pages and viewers that show a run as it goes on.
"""

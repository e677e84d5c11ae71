"""Scenarios, the descriptions of runs: reads their TOML files, applies changes such as those of the
option --set, checks all settings, and returns frozen dataclasses.
"""

"""Scenario files: reads their TOML, applies --set, checks all settings, and returns frozen
dataclasses.
"""

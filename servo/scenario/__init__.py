"""Scenario files: TOML is read, changed by --set, checked, and made into frozen dataclasses."""

"""Scenario files: TOML read, overridden, checked, and filled into frozen values."""

"""The choice of settings of a scenario for a measure under conditions, by a search over runs."""

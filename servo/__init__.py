"""Closing the loop: features, control laws, estimators, scenarios, runs, and everything a person
starts.
"""

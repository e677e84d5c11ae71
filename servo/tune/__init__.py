"""The search for the best settings of a scenario: those that minimise a measure and keep conditions
on other measures, by many runs.
"""

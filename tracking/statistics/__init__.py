"""Statistics of comparisons: intervals, tests, and the verdicts that follow."""

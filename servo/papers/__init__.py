"""Tests of the claims of papers on trackers and visual servoing: for each claim its runs, the rule
that judges the claim, and the verdict.
"""

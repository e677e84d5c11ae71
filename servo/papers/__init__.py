"""Tests of the claims of the three papers: runs, rules and verdicts."""

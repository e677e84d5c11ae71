"""Statistics of comparisons of methods: confidence intervals, tests, and verdicts on claims."""

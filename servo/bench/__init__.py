"""The public benchmarks: worlds that are drawn in frozen conditions, scores, ranks and rows."""

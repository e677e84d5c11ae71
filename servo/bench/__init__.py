"""The public benchmarks of trackers and control laws: random scenarios (worlds) under frozen
conditions, scores, ranks, and published results.
"""

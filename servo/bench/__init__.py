"""The public benchmarks of trackers and control laws: random scenarios (worlds) in frozen
conditions, scores, ranks, and published results.
"""

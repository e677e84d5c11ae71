"""The names of the public benchmarks, which the command line knows without loading one."""

NAMES = (
    "loop-v2",
    "loop-v2-size",
    "loop-v2-all",
    "servo-v2",
    "goal-v1",
    "loop-v1",
    "servo-v1",
)
"""The newest first. One without a JSON file of frozen settings is a draft."""

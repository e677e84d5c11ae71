"""Search for a target: sampling, and local optimisation."""

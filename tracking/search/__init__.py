"""How a target is found: sampling, and local optimisation."""

"""Search for the target's state: particle filter, annealing, velocity and Newton descent."""

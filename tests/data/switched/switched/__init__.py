"""A control law from the literature as a package of its own."""

"""The three papers' experiments, claim by claim."""

"""Jobs of the papers' claims; they go when the claims are studies."""

"""A target's appearance: bins, histograms, kernels, distances."""

"""How a target looks: bins, histograms, kernels, distances."""

"""From a tracker's estimate to what is seen of the target: moments and plane."""

"""From a tracker's estimate to the sight of the target: its moments, corners and plane."""

"""Studies: one scenario, or several, run many times over axes, draws and seeds."""

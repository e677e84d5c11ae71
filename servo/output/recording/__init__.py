"""Rerun recordings: writing, reading, drawing, viewing. The only folder that imports rerun."""

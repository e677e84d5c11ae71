"""Rerun recordings: writing, drawing, viewing. The only folder that imports rerun."""

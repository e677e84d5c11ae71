"""Rerun recordings of runs and tracks: writing, reading, drawing, viewing. This is the only folder
that imports rerun.
"""

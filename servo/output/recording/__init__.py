"""Rerun recordings of runs, tracks and replays: writing, reading, drawing, viewing. No other code
of servobench imports rerun, except for one of its examples.
"""

"""Frames in, estimates out: trackers put together from shared parts. Sees frames, never the world
behind them.
"""

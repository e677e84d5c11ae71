"""Estimates the settings that make a simulated robot move as a real one does, from a log of the
real robot's commands and motion.
"""

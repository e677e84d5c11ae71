"""Compares a robot's log with the film of its camera before the robot is trusted: clock offset,
mount of the camera, mistakes in the log, and a simulation that repeats the recording.
"""

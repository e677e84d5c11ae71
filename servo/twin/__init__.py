"""Compares a robot's log with the film of its camera before the robot is trusted: offset of the
film's clock, mount (pose of the camera in the hand), mistakes in the log, and a simulation that
repeats the recording.
"""

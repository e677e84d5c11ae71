"""Compares a robot's log with the film of its camera before the robot is trusted: estimates the
offset of the film's clock and the mount (pose of the camera in the hand), finds mistakes in log and
film, and simulates the recording.
"""

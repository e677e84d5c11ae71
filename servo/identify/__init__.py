"""Estimates of the settings that simulate a robot, from a log of its commands and motion."""

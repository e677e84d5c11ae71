"""Robots that carry the camera or the target: their joints, velocity drives, forward and inverse
kinematics, and workspaces.
"""

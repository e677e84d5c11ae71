"""Robots that carry the camera: their chain of joints, drives, kinematics and start poses."""

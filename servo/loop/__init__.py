"""Closed loop of tracker and control law: pictures in, camera twists out; the steps of a run (one
for each frame), and the measures computed from them.
"""

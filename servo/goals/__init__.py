"""Goals of a run, one in each file: for a picture, a goal returns the desired view of the target
(its moments, corners, plane and pose in the camera frame).
"""

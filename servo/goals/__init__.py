"""Goals of a run: for each picture, a goal returns the desired view of the target (its moments,
corners, plane and pose in the camera frame), with the picture taken there if a law compares it.
"""

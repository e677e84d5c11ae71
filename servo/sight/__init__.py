"""Package that computes the view of the target (its moments, corners, plane and pose in the camera
frame) from a tracker's estimate.
"""

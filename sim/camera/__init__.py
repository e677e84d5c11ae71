"""The simulated camera: intrinsics, lens distortion, sensor noise, and renderers (OpenGL or
software).
"""

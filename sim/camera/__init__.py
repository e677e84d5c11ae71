"""The simulated camera: settings and intrinsics, lens distortion, exposure and sensor noise, depth
sensor, and renderers (OpenGL or software).
"""

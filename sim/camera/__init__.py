"""The camera: intrinsics, lens and sensor, the renderer, and OpenGL."""

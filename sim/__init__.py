"""The world: MuJoCo scene, gantry, renderer, target motions and disturbances. Knows nothing of
tracking or control.
"""

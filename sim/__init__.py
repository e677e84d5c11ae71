"""The simulated world: MuJoCo scene, robots, camera, renderers, target motions and disturbances. It
imports neither trackers nor control laws.
"""

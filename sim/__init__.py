"""The simulated world: MuJoCo scenes with robots, targets, target motions, disturbances and
surroundings; the camera and its renderers; and recordings in place of rendered scenes. It imports
neither trackers nor control laws.
"""

"""Example of eye-to-hand servoing: the camera is fixed in the room, and the arm moves a tag to its
goal.
"""

import servo

result = servo.simulate("hand_tag", duration=3.0, vary={})
first, last = result[0], result[-1]
print(f"the camera never moves: {abs(last.truth.T_world_camera.translation[2]):.2f} m high")
print(f"corner errors: {first.corner_errors.max():.1f} px at first, {last.corner_errors.max():.2f}")

"""Example of a robot with two joints: a head that pans and tilts keeps a driving car in the middle
of its picture.
"""

import servo

result = servo.simulate("pan_tilt_line", duration=4.0)
angle, size = result[-1].servoed
print(f"servoed: the centre, {'the' if angle else 'no'} angle, {'the' if size else 'no'} size")
print(f"{result.record.measures['servo_rms_px']:.2f} px from the middle (rms)")

"""Example of a custom Rerun recording: it writes pictures, outlines of the target and servo errors
[px] over simulated time to circle.rrd.
"""

import rerun as rr

import servo

rr.init("servobench_example")
rr.save("circle.rrd")
for step in servo.run(servo.load("circle", duration=1.0)):
    rr.set_time("time", duration=step.frame.time)
    rr.log("camera", rr.Image(step.frame.image).compress(jpeg_quality=85))
    outlines = [step.truth.corners, step.goal.corners, step.estimate.outline(step.region)]
    rr.log("camera/outlines", rr.LineStrips2D([[*line, line[0]] for line in outlines]))
    rr.log("error", rr.Scalars(step.servo_error))
rr.disconnect()
print("rerun circle.rrd shows it")

"""Example of a custom robot: three sliding joints and a wrist, written as MJCF."""

from pathlib import Path

import servo

MODEL = """
<mujoco>
  <worldbody>
    <body name="x"> <joint type="slide" axis="1 0 0" range="-1 1"/> <geom size=".05"/>
      <body name="y"> <joint type="slide" axis="0 1 0" range="-1 1"/> <geom size=".05"/>
        <body name="z"> <joint type="slide" axis="0 0 1" range="-.8 .3"/> <geom size=".05"/>
          <body name="wrist"> <joint axis="0 0 1"/> <geom size=".05"/>
            <site name="tool" euler="180 0 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
Path("portal.xml").write_text(MODEL)
robot = {"kind": "mjcf", "model": "portal.xml", "base": [0, 0, 1.2, 0], "flange": "tool"}
result = servo.simulate("circle", robot=robot, duration=2.0)
print(f"{result.outcome.name}, {result[-1].servo_error:.2f} px from the goal")
print("joints at the end [m, m, m, rad]:", result[-1].joints.round(2).tolist())

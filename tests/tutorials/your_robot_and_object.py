# %% [markdown]
# # Your robot and object
#
# A robot is an MJCF or URDF file, an object a mesh:
# [robots](../../scenes/README.md#your-own-robot), [targets](../../scenes/README.md#targets). Here
# both are written by the script, in place of yours.
#
# %%
import json
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import servo

OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))


def servobench(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "servo", *words], check=True, cwd=OUT)


# %% [markdown]
# An arm of six joints with the lengths of a UR5, and a flange `tool`.
#
# %%
JOINTS = {  # its axis, and where it is in the link before [m]
    "pan": ("0 0 1", "0 0 0.09"),
    "lift": ("0 1 0", "0 0.13 0"),
    "elbow": ("0 1 0", "0 -0.12 0.42"),
    "wrist_1": ("0 1 0", "0 0 0.39"),
    "wrist_2": ("0 0 1", "0 0.09 0"),
    "wrist_3": ("0 1 0", "0 0 0.09"),
}
parts, below = ['<robot name="my_arm"><link name="base"/>'], "base"
for name, (axis, place) in JOINTS.items():
    length = 0.39 if name in ("lift", "elbow") else 0.06
    parts.append(f"""
    <link name="{name}_link">
      <inertial><mass value="2"/><origin xyz="0 0 0.1"/>
        <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><origin xyz="0 0 {length / 2}"/>
        <geometry><cylinder radius="0.04" length="{length}"/></geometry></visual>
    </link>
    <joint name="{name}" type="revolute">
      <parent link="{below}"/><child link="{name}_link"/><origin xyz="{place}"/><axis xyz="{axis}"/>
      <limit lower="-6.28" upper="6.28" effort="150" velocity="3.15"/>
    </joint>""")
    below = f"{name}_link"
parts.append("""
    <link name="tool"/>
    <joint name="to_tool" type="fixed"><parent link="wrist_3_link"/><child link="tool"/>
      <origin xyz="0 0.09 0" rpy="-1.5707963 0 0"/></joint>
</robot>""")
(OUT / "my_arm.urdf").write_text("".join(parts))

# %% [markdown]
# An object: an L-shaped bracket as OBJ, in any unit; the scenario's `size` scales it.
#
# %%
outline = [(0, 0), (6, 0), (6, 2), (2, 2), (2, 4), (0, 4)]
lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in outline]
lines += [
    f"f {a} {b} {b + 6} {a + 6}" for a, b in zip(range(1, 7), (2, 3, 4, 5, 6, 1), strict=True)
]
for faces in ("1 4 3 2", "1 6 5 4", "7 8 9 10", "7 10 11 12"):
    lines.append(f"f {faces}")
(OUT / "bracket.obj").write_text("\n".join(lines) + "\n")

# %% [markdown]
# What is in the robot's file, how far it reaches, and where it might stand:
#
# %%
servobench("robot", "my_arm.urdf", "--flange", "tool", "--out", "robot.png")

# %% [markdown]
# A scenario of both, with the bounds that it shall keep.
#
# %%
(OUT / "mine.toml").write_text("""\
# servobench run mine.toml
# My arm follows a bracket that goes to and fro.
[run]
duration = 5.0

[robot]
kind = "mjcf"
model = "my_arm.urdf"
base = [0.0, 0.5, 0.6, -90.0]
flange = "tool"

[target]
kind = "mesh"
file = "bracket.obj"
size = 0.15
colour = "#c03020"

[motion]
kind = "sine"
amplitude = 0.1
frequency = 0.1

[measure]
after = 2.0

[expect]
outcome = "CONVERGED"
servo_rms_px = 2.0
""")
servobench("run", "mine.toml", "--out", "run", "--quiet", "--no-rerun")
report = json.loads((OUT / "run" / "report.json").read_text())
print(f"{report['outcome']}: within {report['measures']['servo_rms_px']:.2f} px rms")

# %% [markdown]
# What the camera sees, and the joints, from Python. The elbow's unrest is the tracker's, which
# hardly sees the size of an object in one colour.
#
# %%
steps = list(servo.run(servo.load(str(OUT / "mine.toml"), ["run.duration=3"])))
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.imshow(steps[-1].frame.image)
corners = steps[-1].truth.corners
left.plot(*np.vstack([corners, corners[:1]]).T, color="white")
left.set_axis_off()
joints = np.array([step.posture.joints for step in steps])
right.plot([step.frame.time for step in steps], np.degrees(joints - joints[0]), label=[*JOINTS])
right.set(xlabel="time [s]", ylabel="joint from its start [deg]")
right.legend(fontsize=7)
figure.savefig(OUT / "your_robot_and_object.png", dpi=120)

"""Clients of cameras and robots in ROS 2, and a simulated camera and robot for other clients, by
DDS (CycloneDDS, extra `ros2`) without installing ROS. Without the extra the import raises a
Mistake.
"""

from importlib.util import find_spec

from servo.mistake import Mistake

if find_spec("cyclonedds") is None or find_spec("rosbags") is None:
    raise Mistake("ROS 2 needs the extra 'ros2': pip install 'servobench[ros2]'")

from servo.ros2.client import Camera, Robot

__all__ = ["Camera", "Robot"]

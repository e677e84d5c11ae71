"""What a pre-flight makes of a log and a film, part by part: the points of a film, the mistakes of a
log, the verdict with its limits, and what is drawn, printed and written.
"""

import csv
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from servo import Mistake
from servo.cli import preflight_command, twin_command
from servo.cli.main import app
from servo.cli.preflight_command import Given, camera_for, made, stated_mount
from servo.closing import closing
from servo.loop.episode import Episode
from servo.output.formats import Made
from servo.scenario.load import load
from servo.twin import section, verdict
from servo.twin.corrections import Correction, Frame, Kind, Smooth, corrections, millimetres, motion, rates
from servo.twin.diagnosis import Diagnosis, Trial
from servo.twin.mount import COUNT, Mount
from servo.twin.offset import OFFSETS, Offset
from servo.twin.readings import (
    clock_of,
    film,
    hand_log,
    is_camera,
    kinematics,
)
from servo.twin.replay import camera_poses, room_of, turned_by, write_replay
from servo.twin.robot_motion import RobotMotion, of_twists
from servo.twin.tracks import Tracks, corners, follow
from servo.twin.verdict import Verdict, believed_mount, judge, preferred, second_axes
from servo.twin.wiggle import rates as wiggle
from servo.twin.wiggle import swings
from sim.models.quaternion import quaternion_of
from sim.types import Camera, Pose
from tracking.drawing.video_writer import VideoWriter
from tracking.sequences.sources import Picture

CAMERA = Camera(100.0, 100.0, 80.0, 60.0, 160, 120)

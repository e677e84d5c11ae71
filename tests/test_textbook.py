"""What the classic schemes do from hard starts, on rendered pictures: the numbers of ViSP's loops.

The bounds of the scenarios are from above; here the retreat is held from both sides.
"""

import pytest
from measured import measured_run

from servo.scenario.load import load

RETREATS = {"turn_90_points": 0.43, "border_points": 0.67, "turn_150_points": 3.09}
"""What the reference loops retreat with exact kinematics [m]; after 2 s the camera comes back."""
NEAR = 0.05


@pytest.mark.parametrize("name", RETREATS)
def test_the_camera_retreats_as_far_as_in_the_reference(name):
    _, report = measured_run(load(name, ["run.duration=2.0"]))
    assert report.measures["retreat_m"] == pytest.approx(RETREATS[name], rel=NEAR)

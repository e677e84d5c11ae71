"""Calibration files of ROS and of OpenCV: what they give, and what is wrong with others."""

import dataclasses

import cv2
import numpy as np
import pytest

from servo.cli import run_command
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from sim.camera.camera import CameraConfig

ROS = """\
image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [520.0, 0.0, 330.5, 0.0, 518.0, 236.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.08, 1e-05, -0.0012, 0.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
PLUMB_BOB = (-0.28, 0.08, 1e-05, -0.0012, 0.0)
RATIONAL = (0.5, 0.2, 1e-3, -2e-3, 0.02, 0.8, 0.3, 0.05)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def opencv(path, coefficients, **more):
    """What calibrations written with cv2.FileStorage have."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in {"image_width": 640, "image_height": 480, **more}.items():
        file.write(name, value)
    file.write("camera_matrix", np.array([[520.0, 0, 330.5], [0, 518.0, 236.0], [0, 0, 1]]))
    file.write("distortion_coefficients", np.array([coefficients]))
    file.release()


def camera_with(*changes):
    return load("still", ["camera.calibration=cam.yaml", *changes]).camera


def check(camera, model, coefficients, scale=1.0):
    assert (camera.width, camera.height) == (640 * scale, 480 * scale)
    # Ours start at the corner of the first pixel, theirs at its middle.
    found = (camera.fx, camera.fy, camera.cx, camera.cy)
    assert found == pytest.approx(np.array([520.0, 518.0, 331.0, 236.5]) * scale, rel=1e-12)
    assert (camera.distortion, camera.coefficients) == (model, pytest.approx(coefficients))
    assert camera.fovy_deg is camera.calibration is None


def test_a_calibration_of_ros(here):
    (here / "cam.yaml").write_text(ROS)
    check(camera_with(), "plumb_bob", PLUMB_BOB)
    check(camera_with("camera.width=320", "camera.height=240"), "plumb_bob", PLUMB_BOB, 0.5)


@pytest.mark.parametrize(
    ("name", "model", "values"),
    [
        ("rational_polynomial", "rational", RATIONAL),
        ("rational_polynomial", "rational", (*RATIONAL, 0.0, 0.0, 0.0, 0.0)),
        ("equidistant", "fisheye", (0.1, -0.02, 0.003, 0.0)),
        ("plumb_bob", "plumb_bob", PLUMB_BOB[:4]),
    ],
)
def test_the_models_of_ros(here, name, model, values):
    text = ROS.replace("plumb_bob", name)
    (here / "cam.yaml").write_text(text.replace(str(list(PLUMB_BOB)), str(list(values))))
    wanted = {"rational": RATIONAL, "fisheye": values, "plumb_bob": PLUMB_BOB}[model]
    check(camera_with(), model, wanted)


@pytest.mark.parametrize(
    ("values", "model", "wanted", "more"),
    [
        (PLUMB_BOB[:4], "plumb_bob", PLUMB_BOB, {}),
        (PLUMB_BOB, "plumb_bob", PLUMB_BOB, {}),
        ((*PLUMB_BOB, *[0.0] * 9), "plumb_bob", PLUMB_BOB, {}),
        (RATIONAL, "rational", RATIONAL, {}),
        ((*RATIONAL, *[0.0] * 6), "rational", RATIONAL, {}),
        ((0.1, 0.0, 0.0, 0.0), "fisheye", (0.1, 0.0, 0.0, 0.0), {"fisheye_model": 1}),
    ],
)
def test_a_calibration_of_opencv(here, values, model, wanted, more):
    opencv(here / "cam.yaml", values, **more)
    check(camera_with(), model, wanted)


NAMES = [
    ("distortion_model", "equidistant", "fisheye"),
    ("distortion_model", "Fisheye", "fisheye"),
    ("camera_model", "KANNALA-BRANDT", "fisheye"),
    ("Camera.type", "KannalaBrandt8", "fisheye"),
    ("model_type", "KANNALA_BRANDT", "fisheye"),
    ("lens_type", "equidistant", "fisheye"),
    ("fisheye_model", "true", "fisheye"),
    ("distortion_model", "radtan", "plumb_bob"),
    ("distortion_model", "", "plumb_bob"),
    ("camera_model", "pinhole", "plumb_bob"),
    ("fisheye_model", "0", "plumb_bob"),
    ("camera_name", "fisheye", "plumb_bob"),
]


@pytest.mark.parametrize("kind", ["cam.xml", "cam.yaml", "ros"])
@pytest.mark.parametrize(("key", "name", "model"), NAMES)
def test_the_lens_is_the_one_that_the_file_names(here, kind, key, name, model):
    """Four coefficients were those of plumb_bob in each of these files of OpenCV, 26 px off."""
    coefficients = (0.04, 0.02, -0.02, 0.009)
    if kind == "ros":
        named = ROS.replace("camera_name: head\n", "")
        named = named.replace("distortion_model: plumb_bob", f"{key}: {name!r}")
        (here / kind).write_text(named.replace(str(list(PLUMB_BOB)), str(list(coefficients))))
    else:
        opencv(here / kind, coefficients, **{key.replace(".", "_"): name})
    camera = load("still", [f"camera.calibration={kind}"]).camera
    rays = np.array([[[np.tan(np.radians(angle)), 0.1, 1.0]] for angle in (10, 20, 30, 40)])
    K = np.array([[520.0, 0, 330.5], [0, 518.0, 236.0], [0, 0, 1]])
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    pixels = project(rays, np.zeros(3), np.zeros(3), K, np.array(coefficients))[0].reshape(-1, 2)
    bent = camera.lens.bend(rays[:, 0, :2])
    found = bent * (camera.fx, camera.fy) + (camera.cx - 0.5, camera.cy - 0.5)
    np.testing.assert_allclose(found, pixels, atol=1e-9)


LINES = {
    "dist_model: equidistant": "fisheye",
    "distortion_model_name: equidistant": "fisheye",
    "lensDistortionModel: Kannala-Brandt": "fisheye",
    "model_name: fisheye": "fisheye",
    "optics: fisheye": "fisheye",
    "camera: {model: fisheye}": "fisheye",
    "distortion: {model: equidistant}": "fisheye",
    "lens: {name: fisheye}": "fisheye",
    "Calibrate_UseFisheyeModel: 1": "fisheye",
    "use_fisheye_model: 1": "fisheye",
    "is_fish_eye: true": "fisheye",
    "use_fisheye_model: 0": "plumb_bob",
    "xi: 0": "plumb_bob",
    "left: {serial_number: fisheye, frame_id: fisheye, title: fisheye 3}": "plumb_bob",
    "sensor: OmniVision OV7251": "plumb_bob",
    "board: {type: aprilgrid}": "plumb_bob",
}


@pytest.mark.parametrize("line", LINES)
def test_a_lens_is_found_in_any_key(here, line):
    """Each was read as plumb_bob, without a word."""
    text = ROS.replace("distortion_model: plumb_bob", line).replace("-0.0012, 0.0]", "-0.0012]")
    (here / "cam.yaml").write_text(text)
    check(camera_with(), LINES[line], PLUMB_BOB[:4] if LINES[line] == "fisheye" else PLUMB_BOB)


def test_a_model_beside_the_coefficients_is_theirs(here):
    text = ROS.replace("distortion_model: plumb_bob\n", "").replace("-0.0012, 0.0]", "-0.0012]")
    (here / "cam.yaml").write_text(text.replace("cols: 5", "model: equidistant"))
    check(camera_with(), "fisheye", PLUMB_BOB[:4])


def test_a_map_of_rows_and_data_in_a_file_of_opencv_is_a_matrix(here):
    """As rtabmap and drivers of cameras write it."""
    text = ROS.replace("plumb_bob", "equidistant").replace("-0.0012, 0.0]", "-0.0012]")
    (here / "cam.yaml").write_text(f"%YAML:1.0\n---\n{text}")
    check(camera_with(), "fisheye", PLUMB_BOB[:4])


def test_a_printed_message_of_ros(here):
    (here / "cam.yaml").write_text(
        "height: 480\nwidth: 640\ndistortion_model: equidistant\nd: [0.1, -0.02, 0.003, 0.0]\n"
        "k: [520.0, 0.0, 330.5, 0.0, 518.0, 236.0, 0.0, 0.0, 1.0]\n---\n"
    )
    check(camera_with(), "fisheye", (0.1, -0.02, 0.003, 0.0))


@pytest.mark.parametrize(
    ("old", "new"), [("rows: 3", "rows: 2"), ("cols: 3", "cols: 9"), ("dt: d", "dt: q")]
)
def test_a_damaged_matrix_of_opencv_is_a_sentence(here, old, new):
    opencv(here / "cam.yaml", PLUMB_BOB)
    text = (here / "cam.yaml").read_text()
    assert old in text
    (here / "cam.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(Mistake, match=r"^cam\.yaml: "):
        load("still", ["camera.calibration=cam.yaml"])


def test_a_calibration_of_opencv_may_end_anywhere(here):
    opencv(here / "cam.yaml", PLUMB_BOB)
    raw = (here / "cam.yaml").read_bytes()
    for end in range(6, len(raw) - 4, 7):
        (here / "cam.yaml").write_bytes(raw[:end])
        try:
            load("still", ["camera.calibration=cam.yaml"])
        except Mistake as mistake:
            assert str(mistake).startswith("cam.yaml: ")  # noqa: PT017


def test_opencvs_older_first_line(here):
    opencv(here / "cam.yaml", PLUMB_BOB)
    text = (here / "cam.yaml").read_text()
    (here / "cam.yaml").write_text("%YAML:1.0\n" + text[text.index("---") :])
    check(camera_with(), "plumb_bob", PLUMB_BOB)


def test_a_calibration_lies_beside_the_scenario_and_is_kept_with_the_run(here):
    (here / "mine").mkdir()
    (here / "mine" / "cam.yaml").write_text(ROS)
    (here / "mine" / "a.toml").write_text('[camera]\ncalibration = "cam.yaml"\nnoise = 1.0\n')
    scenario = load("mine/a.toml")
    check(scenario.camera, "plumb_bob", PLUMB_BOB)
    assert scenario.camera.noise == 1.0
    assert scenario.table["camera"] == {
        "noise": 1.0,
        "width": 640,
        "height": 480,
        "fx": 520.0,
        "fy": 518.0,
        "cx": 331.0,
        "cy": 236.5,
        "distortion": "plumb_bob",
        "coefficients": list(PLUMB_BOB),
    }
    assert scenario.settings()["camera"]["fx"] == 520.0


def test_a_run_through_a_calibration(here):
    (here / "cam.yaml").write_text(ROS)
    changes = ["camera.calibration=cam.yaml", "run.duration=0.1", "expect={}", "start.x=0"]
    code = run_command.run("still", changes, 0, here / "out", quiet=True, no_rerun=True)
    assert code == 0


def test_python_is_told_who_reads_a_calibration():
    own = dataclasses.replace(load("still"), camera=CameraConfig(calibration="cam.yaml"))
    with pytest.raises(Mistake) as refused:
        Episode(own)
    assert str(refused.value) == (
        "still: camera.calibration is read only where a scenario is loaded: give servo.load the "
        'setting "camera.calibration=FILE"'
    )


K = "[520.0, 0.0, 330.5, 0.0, 518.0, 236.0, 0.0, 0.0, 1.0]"
SHAPE = "cam.yaml: camera_matrix should be fx 0 cx, 0 fy cy, 0 0 1, without skew, with focal lengths above zero"
LENSES = (
    "plumb_bob, radtan, radial_tangential, rational_polynomial, rational, equidistant, fisheye, "
    "kannala_brandt, kannala_brandt4, kannala_brandt8"
)
NO_LENS = f"is no known lens model; there is {LENSES} (leave it out if it names no lens)"
NO_YAML = "cam.yaml: this calibration is not valid YAML"
WRONG = {
    "no matrix": ("camera_matrix", "matrix", "cam.yaml: camera_matrix: a value is missing"),
    "a matrix without data": (
        "  data: [520",
        "  date: [520",
        "cam.yaml: camera_matrix = None: input should be a valid list",
    ),
    "eight numbers": (K, "[520.0, 0.0, 330.5, 0.0, 518.0, 236.0, 0.0, 0.0]", SHAPE),
    "nan": ("520.0", ".nan", "cam.yaml: camera_matrix.0 = nan: input should be a finite number"),
    "infinity": (
        "236.0",
        "-.inf",
        "cam.yaml: camera_matrix.5 = -inf: input should be a finite number",
    ),
    "a word": (
        "520.0",
        "wide",
        "cam.yaml: camera_matrix.0 = 'wide': input should be a valid number, unable to parse string as a number",
    ),
    "a list in a list": (
        "520.0",
        "[520.0]",
        "cam.yaml: camera_matrix.0 = [520.0]: input should be a valid number",
    ),
    "a number without end": (
        "520.0",
        "10000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000",
        f"cam.yaml: camera_matrix.0 = 1{'0' * 400}: input should be a valid number",
    ),
    "skew": ("520.0, 0.0", "520.0, 0.1", SHAPE),
    "another last row": ("0.0, 0.0, 1.0]\ndist", "0.0, 0.0, 2.0]\ndist", SHAPE),
    "a negative focal length": (
        "520.0",
        "-520.0",
        SHAPE,
    ),
    "no focal length": (
        "518.0",
        "0",
        SHAPE,
    ),
    "no coefficients": (
        "distortion_coefficients",
        "coefficients",
        "cam.yaml: distortion_coefficients: a value is missing",
    ),
    "an empty list": (
        str(list(PLUMB_BOB)),
        "[]",
        "cam.yaml: distortion_coefficients = []: list should have at least 1 item after validation, not 0",
    ),
    "a coefficient that is none": (
        "-0.28",
        "k1",
        "cam.yaml: distortion_coefficients.0 = 'k1': input should be a valid number, unable to parse string as a number",
    ),
    "two coefficients": (
        str(list(PLUMB_BOB)),
        "[0.1, 0.2]",
        "cam.yaml: distortion_coefficients has 2 numbers, and the lens model plumb_bob has 5: correct the numbers or the model",
    ),
    "six coefficients": (
        str(list(PLUMB_BOB)),
        "[0.1, 0.2, 0.0, 0.0, 0.0, 0.1]",
        "cam.yaml: distortion_coefficients has 6 numbers, and the lens model plumb_bob has 5: correct the numbers or the model",
    ),
    "twelve coefficients, two of them zeros at the end": (
        str(list(PLUMB_BOB)),
        "[0.1, 0.2, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0]",
        "cam.yaml: distortion_coefficients has 12 numbers, and the lens model plumb_bob has 5: correct the numbers or the model",
    ),
    "another model": ("plumb_bob", "kannala", f"cam.yaml: distortion_model = 'kannala' {NO_LENS}"),
    "a model that is no word": (
        "plumb_bob",
        "[a]",
        f"cam.yaml: distortion_model = ['a'] {NO_LENS}",
    ),
    "a lens that is not simulated": (
        "head",
        "head\ncamera_model: omni",
        f"cam.yaml: camera_model = 'omni' {NO_LENS}",
    ),
    "another lens that is not simulated": (
        "head",
        "head\nmodel_type: MEI",
        f"cam.yaml: model_type = 'MEI' {NO_LENS}",
    ),
    "a mirror": ("head", "head\nxi: 1.35", f"cam.yaml: xi = 1.35 {NO_LENS}"),
    "a mirror in a table": (
        "head",
        "head\nmirror_parameters: {xi: 1.2}",
        f"cam.yaml: mirror_parameters.xi = 1.2 {NO_LENS}",
    ),
    "a lens that is named by no usual key": (
        "head",
        "head\ncalibration_method: cv2.fisheye.calibrate",
        "cam.yaml: calibration_method = 'cv2.fisheye.calibrate' is no known lens model; there is "
        f"{LENSES} (leave it out if it names no lens)",
    ),
    "an omnidirectional lens": (
        "head",
        "head\nflags: [CALIB_OMNIDIR]",
        f"cam.yaml: flags = ['CALIB_OMNIDIR'] is no known lens model; there is {LENSES} (leave it out if it "
        "names no lens)",
    ),
    "a model that is called after two": (
        "head",
        "head\nintrinsics_model: opencv_fisheye",
        f"cam.yaml: intrinsics_model = 'opencv_fisheye' {NO_LENS}",
    ),
    "a matrix of nothing": (
        K,
        "[]",
        "cam.yaml: camera_matrix = []: list should have at least 1 item after validation, not 0",
    ),
    "two lenses": (
        "head",
        "head\ncamera_model: fisheye",
        "cam.yaml: camera_model = 'fisheye' and distortion_model = 'plumb_bob' are of different "
        "lenses: leave one out",
    ),
    "a fisheye that is neither": (
        "head",
        "head\nfisheye_model: 7",
        f"cam.yaml: fisheye_model = 7 {NO_LENS}",
    ),
    "a fisheye of five numbers": (
        "plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.28, 0.08, 1e-05, -0.0012, 0.0]",
        "Kannala-Brandt\ndistortion_coefficients: {data: [-0.28, 0.08, 1e-05, -0.0012, 0.1]}",
        "cam.yaml: distortion_coefficients has 5 numbers, and the lens model fisheye has 4: correct the numbers or the model",
    ),
    "no distortion, and its numbers": (
        "plumb_bob",
        "none",
        "cam.yaml: distortion_model = 'none', but distortion_coefficients are given: leave one out",
    ),
    "a model twice": (
        "head",
        "head\ndistortion_model: equidistant",
        "cam.yaml: distortion_model is given twice: leave only the calibration of one camera",
    ),
    "two cameras": (
        "camera_name: head\n",
        "camera_name: head\n---\nimage_width: 320\n",
        "cam.yaml: image_width is given twice: leave only the calibration of one camera",
    ),
    "binning": (
        "image_width",
        "binning_x: 1\nbinning_y: 2\nimage_width",
        "cam.yaml: binning_y = 2: input should be 0 or 1",
    ),
    "a part of the picture": (
        "image_width",
        "roi: {x_offset: 50, y_offset: 40, height: 200, width: 300}\nimage_width",
        "cam.yaml: roi = {'x_offset': 50, 'y_offset': 40, 'height': 200, 'width': 300} is not the whole picture; give the calibration of the whole picture",
    ),
    "no width": ("image_width", "breadth", "cam.yaml: image_width: a value is missing"),
    "a width of zero": ("640", "0", "cam.yaml: image_width = 0: input should be greater than 0"),
    "half a pixel": (
        "480",
        "480.5",
        "cam.yaml: image_height = 480.5: input should be a valid integer, got a number with a fractional part",
    ),
    "not YAML": ("data: [520.0", "data: [520.0]]", f"{NO_YAML}: correct line 7"),
    "a Python object": ("head", "!!python/name:os.system", f"{NO_YAML}: correct line 3"),
    "a date that is none": ("head", "2024-13-45", f"{NO_YAML}: correct it"),
    "a matrix too wide for this picture": (
        "image_width: 640",
        "image_width: 3000",
        "--set camera.calibration=cam.yaml: camera.width = 3000: "
        "input should be less than or equal to 2560",
    ),
    "a principal point far away": (
        "330.5",
        "3305.0",
        "--set camera.calibration=cam.yaml: camera: cx = 3305.5 px is far outside of a picture of "
        "640 px; it should be from -640 to 1280",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_calibration_is_a_sentence(here, name):
    before, after, sentence = WRONG[name]
    assert before in ROS
    (here / "cam.yaml").write_text(ROS.replace(before, after, 1))
    with pytest.raises(Mistake) as refused:
        camera_with()
    assert str(refused.value) == sentence


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (
            b"",
            "cam.yaml: this is no calibration of a camera: camera_matrix is missing: name a file of ROS or OpenCV",
        ),
        (
            b"cam0: {intrinsics: [1, 1, 0, 0], distortion_model: equidistant}",
            "cam.yaml: this is no calibration of a camera: camera_matrix is missing: name a file of ROS or OpenCV",
        ),
        (
            b"[1, 2]",
            "cam.yaml: this is no calibration of a camera: camera_matrix is missing: name a file of ROS or OpenCV",
        ),
        (
            b"\xff\xfe\x00",
            "cam.yaml: cannot read this calibration: it is not UTF-8 text: save it as UTF-8, or give "
            "another file",
        ),
        (
            b"#" * 20_001,
            "cam.yaml: cannot read this calibration: it is too large; the limit is 20,000 bytes",
        ),
        (None, "cam.yaml: cannot read this calibration: No such file or directory"),
    ],
)
def test_a_file_that_is_no_calibration_is_a_sentence(here, content, sentence):
    if content is not None:
        (here / "cam.yaml").write_bytes(content)
    with pytest.raises(Mistake) as refused:
        camera_with()
    assert str(refused.value) == sentence


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("camera.fx=300", "fx and calibration both give the lens; leave one out"),
        ("camera.fovy_deg=45", "fovy_deg and calibration both give the lens; leave one out"),
        ("camera.cy=45", "cy and calibration both give the lens; leave one out"),
        (
            "camera.distortion=fisheye",
            "distortion and calibration both give the lens; leave one out",
        ),
        (
            "camera.width=320",
            "320 x 480 px has another aspect ratio than the 640 x 480 px of cam.yaml: correct camera.width or camera.height",
        ),
        (
            "camera.height=640",
            "640 x 640 px has another aspect ratio than the 640 x 480 px of cam.yaml: correct camera.width or camera.height",
        ),
    ],
)
def test_what_does_not_fit_a_calibration_is_a_sentence(here, change, sentence):
    (here / "cam.yaml").write_text(ROS)
    with pytest.raises(Mistake) as refused:
        camera_with(change)
    assert str(refused.value) == f"--set {change}: camera: {sentence}"

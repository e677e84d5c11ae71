"""The TraX protocol: our client with a small server, in each version and format, and our server."""

import dataclasses
import gc
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from commands import PATIENCE
from followed import REGION, START, frame

from servo.loop.episode import Episode
from servo.scenario.load import load
from tracking.exported.trax_server import run_trax
from tracking.guests import trax_messages as messages
from tracking.trackers.trax import Config
from tracking.types import State, Status

SERVER = Path(__file__).parent / "tools" / "trax_server.py"


def config(*words, timeout=10.0, **settings):
    command = " ".join([sys.executable, str(SERVER), *words])
    return Config(command=command, timeout=timeout, **settings)


def follow(settings, count=6, region=REGION, start=START):
    tracker = settings.build(np.random.default_rng(0))
    tracker.start(frame(0), region, start)
    return [tracker.update(frame(k)) for k in range(1, count)]


@pytest.mark.parametrize("picture", ["path", "memory", "buffer"])
@pytest.mark.parametrize("version", ["1", "3", "4"])
def test_a_server_of_any_version_and_format_is_followed(version, picture):
    found = follow(config("good", version, "rectangle", picture))
    assert [e.state for e in found] == [State(55.0 + 2 * k, 40.0) for k in range(1, 6)]
    assert {(e.status, e.follows, e.corners) for e in found} == {
        (Status.LOCKED, (False, False), None)
    }
    np.testing.assert_allclose([e.distance for e in found], [0.1, 0.1, 0.1, 0.1, 0.9])


def test_upright_corners_are_boxes():
    """A box is never turned into corners: neither angle nor tilt is measured."""
    found = follow(config("good", "4", "polygon", "path"))
    assert [e.state for e in found] == [State(55.0 + 2 * k, 40.0) for k in range(1, 6)]
    assert {(e.follows, e.corners) for e in found} == {((False, False), None)}


def test_corners_in_another_order_turn_the_region():
    """The server turns them about the middle, and begins with the third."""
    found = follow(config("turns", "4", "polygon", "path"))
    angle = np.arctan2(0.6, 0.8)
    for estimate in found:
        assert estimate.state.theta == pytest.approx(angle, abs=1e-4)
        assert estimate.state.scale == pytest.approx(1.0, abs=1e-4)
        assert (estimate.follows, estimate.corners) == ((True, False), None)  # of a rectangle


def test_a_target_that_turns_back_passes_the_upright_angle():
    """The server turns it from 30 deg by 10 deg a picture: at 0 deg its corners are upright."""
    found = follow(config("turns_back", "4", "polygon", "path"), start=State(55.0, 40.0, np.pi / 6))
    angles = [np.degrees(estimate.state.theta) for estimate in found]
    assert angles == pytest.approx([20, 10, 0, -10, -20], abs=0.01)
    assert [estimate.state.scale for estimate in found] == pytest.approx([1] * 5, abs=1e-3)


def test_corners_of_no_rectangle_and_declared_ones_are_reported():
    tilted = follow(config("tilts", "4", "polygon", "path"))
    expected = REGION.corners(START) + [(0, 0), (2, 3), (0, 0), (0, 0)]
    for k, estimate in enumerate(tilted, 1):
        np.testing.assert_allclose(estimate.corners, expected + (2 * k, 0), atol=1e-6)
        np.testing.assert_array_equal(estimate.outline(REGION), estimate.corners)
    declared = follow(config("turns", "4", "polygon", "path", "corners;angle"))
    expected = REGION.corners(State(55.0, 40.0, np.arctan2(0.6, 0.8)))
    for estimate in declared:
        np.testing.assert_allclose(estimate.corners, expected, atol=1e-5)
        assert estimate.follows == (True, False)


def test_a_turned_region_goes_as_corners_where_they_are_taken_else_as_its_box():
    turned = State(55.0, 40.0, 0.5)
    corners = follow(config("good", "4", "rectangle;polygon", "path"), 3, start=turned)[-1]
    np.testing.assert_allclose(corners.state.vector, State(59.0, 40.0, 0.5).vector, atol=1e-6)
    assert (corners.corners, corners.follows) == (None, (True, False))
    box = follow(config("good", "4", "rectangle", "path"), 3, start=turned)[-1]
    assert (box.state.theta, box.corners, box.follows) == (0.5, None, (False, False))
    assert (box.state.x, box.state.y) == pytest.approx((59.0, 40.0))


def test_a_mask_is_the_box_around_it():
    """The server takes masks only, and answers with the one that it was given."""
    found = follow(config("echoes", "4", "mask", "path"), 3)
    assert [e.state for e in found] == [START] * 2
    assert {(e.follows, e.corners) for e in found} == {((False, False), None)}
    unseen = follow(config("empty", "4", "mask", "path"), 3)
    assert {e.status for e in unseen} == {Status.UNSURE}


def test_its_confidence_may_judge():
    found = follow(config("good", least_confidence=0.3))
    assert [e.status.name for e in found] == ["LOCKED"] * 4 + ["UNSURE"]
    np.testing.assert_allclose([e.distance for e in found], [0.1] * 4 + [0.9])
    assert {e.status for e in follow(config("good"))} == {Status.LOCKED}


def test_a_target_that_the_server_does_not_see_is_unseen():
    found = follow(config("lost"), count=14)
    assert (found[0].status, found[-1].status) == (Status.UNSURE, Status.LOST)
    assert {(e.distance, e.state) for e in found} == {(1.0, START)}


@pytest.mark.parametrize("version", ["5", "banana"])
def test_a_version_that_we_do_not_speak_is_refused(version):
    said = f"speaks version '{version}' of TraX; servobench speaks 1 to 4"
    with pytest.raises(ValueError) as refused:
        follow(config("good", version))
    assert said in str(refused.value)


UNKNOWN = "which is wrong: a region of TraX should be a rectangle, a polygon or a mask"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("dies", "ended with code 1 instead of sending 'hello': no weights found"),
        (
            "raises",
            "ended with code 1 instead of sending 'hello': in load | 1 / 0 | no division by 0",
        ),
        ("crashes", "ended with code 3 instead of sending 'state': out of memory"),
        ("leaves", "ended with code 0 instead of sending 'state'"),
        ("hello", "sent 'hello' instead of 'state'"),
        ("nonsense", f'answered @@TRAX:state "here, or there", {UNKNOWN}'),
        ("nan", f'answered @@TRAX:state "nan,1,2,3", {UNKNOWN}'),
        ("three", f'answered @@TRAX:state "1,2,3", {UNKNOWN}'),
        ("none", "answered @@TRAX:state, which is wrong: expected one region"),
        (
            "wrong",
            'answered @@TRAX:state "m0,0,2,2,1,9", which is wrong: the mask of the region has runs that do not fit its width and height',
        ),
        ("unsure", "reports the confidence 'high'; it must be from 0 to 1"),
        (
            "good 4 circle path",
            "accepts a region only as circle; servobench sends mask, polygon, rectangle",
        ),
        (
            "good 4 rectangle path colour",
            "declares that it gives 'colour'; it may give size, angle, corners",
        ),
        (
            "good 4 rectangle url",
            "accepts a picture only as url; servobench sends buffer, data, memory, path",
        ),
    ],
)
def test_a_server_that_fails_is_a_sentence(words, message):
    settings = config(*words.split())
    with pytest.raises(ValueError) as refused:
        follow(settings)
    failed = "" if message.startswith("declares") else "failed: it "
    assert str(refused.value) == f"TraX server '{settings.command}' {failed}{message}"


def test_an_answer_of_a_megabyte_is_read_whole():
    """A polygon of 240,000 corners."""
    found = follow(config("long"), count=3)
    assert [e.state for e in found] == [State(57.0, 40.0)] * 2


def test_what_a_server_writes_without_an_end_does_not_matter():
    assert follow(config("writes"), count=3)[-1].state == State(59.0, 40.0)


def test_a_box_without_an_area_is_a_sentence():
    settings = config("negative")
    with pytest.raises(ValueError) as refused:
        follow(settings)
    assert str(refused.value) == (
        f"TraX server '{settings.command}' answered [1.0, 2.0, -3.0, 4.0]; expected a box of left, "
        "top, width, height [px] (finite numbers up to 1e+06, with an area, or all zeros: not seen), (ok, box), or a mapping "
        "with some of the keys box, angle, corners, seen, confidence"
    )


def test_a_box_whose_area_vanishes_has_none():
    with pytest.raises(
        ValueError, match=r"width, height \[px\] \(finite numbers up to 1e\+06, with an area"
    ):
        follow(config("vanishes"))


@pytest.mark.parametrize(
    ("mode", "wanted", "limit"), [("silent", "hello", "loading"), ("hangs", "state", "timeout")]
)
def test_a_server_that_hangs_is_ended(mode, wanted, limit, monkeypatch):
    monkeypatch.setattr("tracking.guests.process.GRACE", 0.0)  # it does not hear that it should end
    settings, began = config(mode, **{limit: 0.4}), time.monotonic()
    with pytest.raises(ValueError, match=rf"did not send '{wanted}' within 0\.4 s$"):
        follow(settings)
    assert time.monotonic() - began < 30  # not the minute that it sleeps


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            "",
            "the command of the TraX server is empty: give it with --set or from Python (not in a TOML file), such as command = 'python my_program.py'",
        ),
        (
            "no-such-program x",
            "TraX server 'no-such-program x' cannot be started: No such file or directory",
        ),
        ("'open", "TraX server ''open' cannot be started: No closing quotation"),
    ],
)
def test_a_command_that_is_none_is_a_sentence(command, message):
    with pytest.raises(ValueError) as refused:
        follow(Config(command=command))
    assert str(refused.value) == message


def test_a_confidence_that_is_to_judge_must_come():
    settings = config("lost", least_confidence=0.3)
    assert follow(settings)[0].status is Status.UNSURE
    silent = dataclasses.replace(settings, command=settings.command.replace("lost", "plain"))
    with pytest.raises(
        ValueError, match=r"reports no confidence, but least_confidence = 0\.3 needs"
    ):
        follow(silent)


def test_no_process_and_no_file_stays(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    before = set(psutil.Process().children(recursive=True))
    tracker = config("good").build(np.random.default_rng(0))
    for _ in range(2):  # a second start has a server of its own
        tracker.start(frame(0), REGION, START)
        for k in range(1, 4):
            tracker.update(frame(k))
        servers = set(psutil.Process().children(recursive=True)) - before
        assert len(list(tmp_path.rglob("*.png"))) == 2
    assert servers
    del tracker
    assert not any(server.is_running() for server in servers)
    assert list(tmp_path.iterdir()) == []


def served(*lines, kind="frozen"):
    out = io.StringIO()
    run_trax(kind, requests=io.StringIO("\n".join(lines)), answers=out)
    return out.getvalue().splitlines()


def test_our_server_answers_both_ways_to_begin(tmp_path):
    picture = messages.picture_text(frame(0).image, ["path"], tmp_path / "0.png")
    one = served("noise", f'@@TRAX:initialize "{picture}" "40,30,30,20"', f"@@TRAX:frame {picture}")
    two = served(
        '@@TRAX:initialize "40,30,30,20"',
        f"@@TRAX:frame {picture}",
        f"@@TRAX:frame {picture}",
        "@@TRAX:quit",
        "@@TRAX:frame never",
    )
    assert one == two
    assert one[0].startswith('@@TRAX:hello "trax.version=4" "trax.region=rectangle;polygon;"')
    place = '@@TRAX:state "40,30,30,20"'
    unseen = f'{place} "confidence=0.000000" "seen=0"'
    assert one[1:] == [f'{place} "confidence=1.000000"', unseen]
    polygon = served('@@TRAX:initialize "40,30,70,30,70,50,40,50"', f"@@TRAX:frame {picture}")
    assert polygon[1].startswith('@@TRAX:state "40,30,70,30,70,50')


NOTING = """
from tracking.trackers import frozen

NOTES = []


class Config(frozen.Config):
    def build(self, rng):
        NOTES.append("built")
        return frozen.Config().build(rng)
"""


def test_what_compiles_does_so_before_the_hello(tmp_path, monkeypatch):
    (tmp_path / "noting_tracker.py").write_text(NOTING)
    monkeypatch.syspath_prepend(tmp_path)
    from noting_tracker import NOTES

    class Out(io.StringIO):
        def write(self, line):
            NOTES.append(line.split()[0])

    run_trax("noting_tracker:Config", requests=[REGION_LINE, FRAME_LINE], answers=Out())
    assert NOTES == ["built", "built", "@@TRAX:hello", "@@TRAX:state"]


def test_a_wrong_setting_is_a_sentence_before_the_hello():
    out = io.StringIO()
    with pytest.raises(ValueError, match="particles"):
        run_trax("kams", requests=[], answers=out, particles=-1)
    assert out.getvalue() == ""


PICTURE = messages.picture_text(frame(0).image, ["memory"], Path())
REGION_LINE = '@@TRAX:initialize "40,30,30,20"'
FRAME_LINE = f"@@TRAX:frame {PICTURE}"


def test_polygons_of_other_than_four_corners_are_followed_by_their_box():
    """The hello announces polygons, and the protocol's have three corners or more."""
    for polygon in ("40,30,70,30,70,50", "40,30,60,30,70,40,70,50,40,50"):
        found = served(f'@@TRAX:initialize "{polygon}"', FRAME_LINE, FRAME_LINE)
        numbers = [found[k].split('"')[1] for k in (1, 2)]
        assert [float(n) for n in numbers[0].split(",")] == [float(n) for n in polygon.split(",")]
        assert [float(n) for n in numbers[1].split(",")] == [40, 30, 70, 30, 70, 50, 40, 50]


def test_a_target_may_be_given_anew():
    lines = served(REGION_LINE, FRAME_LINE, '@@TRAX:initialize "50,30,20,20"', FRAME_LINE)
    assert [line.split('"')[1] for line in lines[2:]] == ["50,30,20,20"]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([FRAME_LINE], "the client sent '@@TRAX:frame \"image:160;100;rgb;"),
        (["@@TRAX:initialize"], "the client sent '@@TRAX:initialize', but one region is expected"),
        (
            [REGION_LINE, REGION_LINE],
            "the client sent '@@TRAX:initialize \"40,30,30,20\"', but one",
        ),
        ([REGION_LINE, "@@TRAX:frame"], "the client sent '@@TRAX:frame', but one region"),
        (["@@TRAX:hello a"], "the client sent '@@TRAX:hello \"a\"', but one region is expected"),
        ([REGION_LINE, FRAME_LINE, "@@TRAX:state 1"], "the client sent '@@TRAX:state"),
        (['@@TRAX:initialize "40,30,-30,-20"'], "region '40,30,-30,-20' has no area"),
        (['@@TRAX:initialize "40,30,30,-20"'], "region '40,30,30,-20' has no area"),
        (['@@TRAX:initialize "0"'], "the client's region '0' has no area: send one that has"),
        (
            ['@@TRAX:initialize "nan,1,2,3"'],
            "the client's region 'nan,1,2,3' cannot be used: a region of TraX",
        ),
        (['@@TRAX:initialize "m0,0,2,2,1"'], "region 'm0,0,2,2,1' has no area"),
        (['@@TRAX:initialize "40,30,60,30,80,30"', FRAME_LINE], "the region is 40 x 0 px; both"),
        ([REGION_LINE, "@@TRAX:frame /no/such.png"], "/no/such.png: cannot read this picture"),
    ],
)
def test_a_client_that_fails_is_a_sentence(lines, message):
    with pytest.raises(ValueError) as refused:
        served(*lines)
    assert message in str(refused.value)


def program(words, close="", **more):
    """Our server as a program; exit code and stderr."""
    line = f"exec {sys.executable} -m tracking.exported.trax_server {words} {close}"
    done = subprocess.run(line, shell=True, capture_output=True, text=True, **more)
    return done.returncode, done.stderr.splitlines()


def test_the_program_ends_with_a_sentence():
    lines = f'{REGION_LINE}\n@@TRAX:frame "file:///\x1b[31m.png"\n'
    code, (said,) = program("frozen", input=lines)
    assert (code, said) == (
        1,
        "trax_server: /[31m.png: cannot read this picture: No such file or directory",
    )
    code, (*_, said) = program("frozen", close=">&-", input="")
    assert code == 2
    assert said.endswith("standard input or output is closed, but a client needs both")


def test_ctrl_c_ends_the_program_without_a_traceback():
    command = [sys.executable, "-m", "tracking.exported.trax_server", "frozen"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stdout.readline().startswith(b"@@TRAX:hello")
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=PATIENCE)[1] == b""
        assert process.returncode == 130


KILLED = """
import sys

import numpy as np
from commands import PATIENCE
from followed import REGION, START, frame

from tracking.trackers.trax import Config

tracker = Config(command=sys.argv[1]).build(np.random.default_rng(0))
tracker.start(frame(0), REGION, START)
print("started", flush=True)
sys.stdin.read()
"""


def test_a_server_ends_with_its_run_and_waits_for_no_garbage_collector():
    scenario = load("still", ["run.duration=0.2"])
    with Episode(scenario):  # imports OpenGL, whose record in pytest's log keeps the frames alive
        pass
    scenario = dataclasses.replace(scenario, tracker=config())
    gc.collect()
    gc.disable()
    try:
        with Episode(scenario) as episode:
            steps = len(list(episode))
        del episode
        servers = [p for p in psutil.Process().children() if str(SERVER) in p.cmdline()]
        _, left = psutil.wait_procs(servers, timeout=5)  # one that is about to end
    finally:
        gc.enable()
    assert steps > 0
    assert not left


@pytest.mark.processes
@pytest.mark.parametrize("mode", ["good", "stays"])
def test_a_kill_leaves_no_folder_and_no_server(tmp_path, mode):
    (tmp_path / "main.py").write_text(KILLED)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "main.py"), config(mode).command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"TMPDIR": str(temporary), "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert process.stdout.readline() == b"started\n"
    (server,) = [p for p in psutil.Process(process.pid).children() if str(SERVER) in p.cmdline()]
    assert list(temporary.iterdir())
    process.kill()
    process.communicate()
    psutil.wait_procs([server], timeout=PATIENCE)
    assert not server.is_running()
    until = time.monotonic() + PATIENCE
    while list(temporary.iterdir()) and time.monotonic() < until:
        time.sleep(0.02)
    assert list(temporary.iterdir()) == []


def test_ours_over_the_protocol_is_ours_and_closes_the_loop():
    command = f"{sys.executable} -m tracking.exported.trax_server mk_ssd"
    tracker = Config(command=command)
    scenario = dataclasses.replace(load("still", ["run.duration=0.4"]), tracker=tracker)
    with Episode(scenario) as episode:
        last = [step.light() for step in episode][-1]
    assert last.estimate.status is Status.LOCKED
    found = last.estimate.state
    assert (last.estimate.corners, last.estimate.follows[0]) == (None, True)
    assert np.hypot(found.x - last.truth.centre[0], found.y - last.truth.centre[1]) < 2.0


REFERENCE = """
import trax
with trax.Server(["polygon"], ["memory"]) as server:
    while (asked := server.wait()).type != "quit":
        if asked.type == "initialize":
            corners, count = list(asked.objects[0][0]), -1
        count += 1
        moved = [(x + 2 * count, y) for x, y in corners]
        server.status([(trax.Polygon.create(moved), {"confidence": 0.8})])
"""


def test_the_reference_server_is_followed(tmp_path):
    pytest.importorskip("trax", reason="vot-trax is not installed")
    (tmp_path / "server.py").write_text(REFERENCE)
    command = f"{sys.executable} {tmp_path / 'server.py'}"
    found = follow(Config(command=command))
    assert [e.state.x for e in found] == pytest.approx([57.0, 59.0, 61.0, 63.0, 65.0])
    assert {round(e.distance, 6) for e in found} == {0.2}

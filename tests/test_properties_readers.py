"""Whatever bytes a file holds, its reader gives what it should, or the sentence it documents."""

import itertools

import bags
import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servo.cli.track_command import region_of
from servo.mistake import Mistake
from servo.output.recording import view
from servo.study import suites
from sim.files.picture_file import read_image
from sim.types import Frame
from tracking.evaluation import track_file
from tracking.sequences import quadrilateral, truth
from tracking.sequences.bag_file import Bag, is_bag
from tracking.sequences.sequence import read_all, source_of
from tracking.sequences.video_file import MOST_MISSING, Video
from tracking.types import FARTHEST, check_region

NOISE = np.random.default_rng(2).integers(0, 256, (9, 7, 3), np.uint8)
PNG, JPEG, DOT = (
    cv2.imencode(suffix, image)[1].tobytes()
    for suffix, image in ((".png", NOISE), (".jpg", NOISE), (".png", NOISE[:1, :1]))
)
TRUTHS = [
    b"11,21,30,40\n12,21,30,40\n",
    b"10,20,40,20,40,60,10,60\nnan,nan,nan,nan\n",
    b"frame,left,top,width,height\n0,10,20,30,40\n1,,,,\n",
    b'x1,y1,x2,y2,x3,y3,x4,y4,note\n10,20,40,20,40,60,10,60,"a"\n,,,,,,,,b\n',
]
NAMES = ("groundtruth_rect.txt", "groundtruth.txt", "mine.csv")
SUITE = b"""[[sequences]]
kind = "clutter"
level = "d"
[[sequences]]
path = "."
[[trackers]]
kind = "kams"
preset = "paper"
label = "KAMS, as published"
"""
PIECES = st.one_of(
    st.binary(max_size=12),
    st.sampled_from([b"nan", b"inf", b"1e999", b"-1e308", b'"', b"\0", b"9" * 400, b"\r", b",,,"]),
    st.sampled_from([b"[", b"{", b"'", b"= 1\n", b"= []\n", b"../", b"[[sequences]]\n", b"\x1b"]),
)


@st.composite
def mutated(draw, *originals):
    """One of the originals with up to three pieces of it replaced; or no such thing at all."""
    text = draw(st.sampled_from(originals))
    for _ in range(draw(st.integers(0, 3))):
        begin = draw(st.integers(0, len(text)))
        end = draw(st.integers(begin, min(begin + 20, len(text))))
        text = text[:begin] + draw(PIECES) + text[end:]
    return draw(st.sampled_from([text, text, text[: len(text) // 2]]))


WORDS = st.sampled_from(["nan", "1e999", "-1e308", "1e308", "1e7", "", "x", "-3.5", "0", "20"])
ROWS = st.lists(WORDS, min_size=4, max_size=4) | st.lists(WORDS, min_size=8, max_size=8)
TABLES = st.lists(ROWS.map(",".join), max_size=3).map(lambda rows: "\n".join(rows).encode())
ITEMS = st.sampled_from(
    [
        "3",
        "'ab'",
        "[3]",
        "[{}]",
        "[{kind = 3}]",
        "[{kind = 'clutter'}]",
        "[{kind = 'kams'}]",
        "[{path = 3}]",
        "[{path = '..'}]",
        "{a = 1}",
        "[]",
        "[{kind = 'sok', label = 3}]",
        "[{kind = 'sok', label = '../a'}]",
        "[{path = 'a\u0000'}]",
        "1979-05-27",
    ]
)
SUITES = st.tuples(ITEMS, ITEMS).map(lambda two: "sequences={}\ntrackers={}".format(*two).encode())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def read(call, *args, error=ValueError):
    """The result, or None where the documented sentence was said; nothing else may be raised."""
    refused = None
    try:
        return call(*args)
    except error as raised:
        refused = raised
    # Its own sentence, not one of Python's.
    assert type(refused) is error or type(refused).__module__.startswith("servo.")
    assert str(refused)
    assert error is ValueError or str(refused).isprintable()
    return None


@settings(max_examples=150)
@given(st.binary(max_size=40) | mutated(*TRUTHS) | TABLES, st.sampled_from(NAMES))
def test_a_truth_is_places_in_a_picture_or_a_sentence(folder, content, name):
    path = folder / name
    path.write_bytes(content)
    corners = read(truth.read, path)
    if corners is not None:
        assert corners.shape == (len(corners), 4, 2)
        known = np.isfinite(corners).all(axis=(1, 2))
        assert np.isnan(corners[~known]).all()
        assert np.abs(corners[known]).max(initial=0) <= 2 * FARTHEST + 1
        for one in corners[known]:
            region, state = quadrilateral.placement(one)
            assert np.isfinite([region.width, region.height, state.x, state.y, state.theta]).all()


@settings(max_examples=150)
@given(st.binary(max_size=40) | mutated(PNG, JPEG, DOT))
def test_a_picture_is_rgb_or_a_sentence(folder, content):
    path = folder / "any.png"
    path.write_bytes(content)
    image = read(read_image, path)
    if image is not None:
        assert image.dtype == np.uint8
        assert image.shape[2] == 3
        assert not image.flags.writeable


def test_a_picture_of_one_pixel_is_read(folder):
    (folder / "dot.png").write_bytes(DOT)
    np.testing.assert_array_equal(read_image(folder / "dot.png"), NOISE[:1, :1, ::-1])


@settings(max_examples=150)
@given(st.binary(max_size=40) | mutated(SUITE) | SUITES)
def test_a_suite_is_runs_or_one_sentence(folder, content):
    path = folder / "suite.toml"
    path.write_bytes(content)
    found = read(suites.suite, str(path), error=Mistake)
    if found is not None:
        entries, contenders = found
        assert all("/" not in f"{e.name}{c.label}" for e in entries for c in contenders)


@given(st.text() | st.text(max_size=300).map(lambda text: f"clutter,{text}"))
def test_any_choice_of_trackers_is_one_or_a_sentence(text):
    read(suites.contenders, text, error=Mistake)
    if text != suites.CLOSED_LOOP:
        read(suites.suite, text, error=Mistake)


@pytest.fixture(scope="module")
def film(folder):
    path = folder / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (32, 24))
    for _ in range(3):
        writer.write(cv2.resize(NOISE, (32, 24)))
    writer.release()
    return path.read_bytes()


@settings(max_examples=40)
@given(st.data())
def test_a_video_is_pictures_or_a_sentence_and_ends(folder, film, data):
    path = folder / "any.avi"
    path.write_bytes(data.draw(mutated(film)))
    video = read(Video.of, path)
    for picture in itertools.islice(video or (), 2 * MOST_MISSING):
        assert picture.image is None or picture.image.shape[2] == 3


@pytest.fixture(scope="module", params=["log.bag", "log.mcap"])
def log(request, folder):
    def pictures(store):
        return [(k, bags.RAW, bags.raw(store, k, NOISE[:6, :6], "bgr8")) for k in range(3)]

    return bags.write(folder / request.param, {"/eye": pictures}).read_bytes()


@settings(max_examples=60)
@given(st.data())
def test_a_bag_is_pictures_or_a_sentence(folder, log, data):
    path = folder / "any.bag"
    path.write_bytes(data.draw(mutated(log)))
    bag = read(Bag, path, None) if is_bag(path) else None
    if bag is not None:
        found = read(list, bag) or ()
        assert all(p.image is None or p.image.shape[2] == 3 for p in found)


@given(st.binary(max_size=60) | mutated(b"RRF2\x00\x00\x00\x00", b"RRIO1234"))
def test_a_recording_is_told_from_anything_else(folder, content):
    path = folder / "any.rrd"
    path.write_bytes(content)
    refused = None
    try:
        view.check(path)
    except Mistake as mistake:
        refused = str(mistake)
    right = content[:4] in view.MAGIC
    assert refused == (None if right else f"{path}: this is not a Rerun recording (.rrd): name one")


@given(st.text() | st.sampled_from(["a" * 5000, "\0", "\ud800", ".", "/", "camera:" + "9" * 5000]))
def test_any_name_of_a_file_is_one_or_a_sentence(folder, name):
    read(view.check, folder / name / "run.rrd", error=Mistake)
    read(view.check, view.recording_in(folder / name[:99].replace("\0", "")), error=Mistake)
    read(source_of, name, 30.0)
    read(read_all, folder / name, 30.0)
    read(truth.read, folder / name / "none.txt")
    read(suites.suite, f"{folder}/none/{name}.toml", error=Mistake)


TRACK = (",".join(track_file.HEADER) + "\n" + ",".join("1" * 21) + "\n").encode()


@settings(max_examples=150)
@given(st.binary(max_size=40) | mutated(TRACK))
def test_a_track_is_one_or_a_sentence(folder, content):
    path = folder / "track.csv"
    path.write_bytes(content)
    track = read(track_file.read, path)
    if track is not None:
        assert track.corners.shape == (len(track.states), 4, 2)


NUMBERS = st.floats().map(str) | st.integers().map(str) | st.text(max_size=3)


@given(st.text() | st.lists(NUMBERS, min_size=3, max_size=6).map(",".join))
def test_any_region_on_the_command_line_is_one_or_a_sentence(text):
    found = read(region_of, text, error=Mistake)
    if found is not None:
        read(check_region, Frame(NOISE, 0.0, 0), *found)

"""Bags as sources: every container and serialization, and what is damaged in them."""

import sys

import cv2
import numpy as np
import pytest

from tracking.sequences.bag_file import Bag
from tracking.sequences.sequence import source_of

bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
messages = pytest.importorskip("foxglove.messages", reason="foxglove-sdk is not installed")
WIDTH, HEIGHT, FRAMES = 30, 20, 5
STAMPS = [0.0, 0.05, 0.1, 0.3, 0.35]  # one picture came late
FORMS = ["log.mcap", "log.bag", "log_db3", "log_mcap"]


COLOUR = (200, 20, 40)  # RGB


def full(*values):
    return np.full((HEIGHT, WIDTH, len(values)), values, np.uint8)


def shade(k):
    """A red picture (BGR), brighter with k, blue at its left edge."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[..., 2] = 100 + 20 * k
    image[:, :4] = (255, 0, 0)
    return image


def pictures(k0=0, form="raw"):
    """Images that were recorded 0.5 s after their stamps."""

    def make(store):
        kind = bags.RAW if form == "raw" else bags.COMPRESSED
        for k, stamp in enumerate(STAMPS):
            time = bags.START + stamp
            image = shade(k + k0)
            if form == "raw":
                yield time + 0.5, kind, bags.raw(store, time, image, "bgr8", padding=6)
            else:
                yield time + 0.5, kind, bags.jpeg(store, time, image)

    return lambda store: list(make(store))


def words(store):
    return [(bags.START, bags.TEXT, bags.text(store))]


@pytest.fixture
def two(tmp_path):
    """A function: a bag of a form, with two topics of pictures and one of texts."""
    topics = {"/left": pictures(), "/right/compressed": pictures(3, "png"), "/words": words}
    return lambda form: bags.write(tmp_path / form, topics)


@pytest.mark.parametrize("form", FORMS)
def test_a_topic_is_read_with_the_stamps_of_its_headers(two, form):
    path = two(form)
    for topic, k0 in (("/left", 0), ("/right/compressed", 3)):
        bag = source_of(str(path), 30.0, topic)
        found = list(bag)
        assert (bag.count, bag.end) == (FRAMES, None)
        assert [p.time for p in found] == pytest.approx(STAMPS, abs=1e-6)
        assert [p.name for p in found] == [f"message {k}" for k in range(FRAMES)]
        for k, picture in enumerate(found):
            expected = shade(k + k0)[..., ::-1]
            np.testing.assert_array_equal(picture.image, expected)
            assert not picture.image.flags.writeable


def test_one_file_of_a_folder_is_a_bag_too(two):
    (file,) = two("log_db3").glob("*.db3")
    assert [p.time for p in Bag(file, "/left")] == pytest.approx(STAMPS, abs=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_a_topic_must_be_clear(two, form):
    path = two(form)
    for topic, sentence in (
        (
            None,
            "there are several topics with pictures: /left (5), /right/compressed (5); choose one "
            "with --topic, or give a scenario a bag with one of them",
        ),
        (
            "/words",
            "this bag has no topic '/words' with pictures; it has /left (5), /right/compressed (5)",
        ),
    ):
        with pytest.raises(ValueError) as refused:
            source_of(str(path), 30.0, topic)
        assert str(refused.value) == f"{path}: {sentence}"


def test_a_bag_without_pictures_lists_what_it_has(tmp_path):
    path = bags.write(tmp_path / "log.bag", {"/words": words})
    with pytest.raises(ValueError) as refused:
        Bag(path, None)
    assert str(refused.value) == (
        f"{path}: this bag has no topic with pictures that can be read (sensor_msgs or "
        "foxglove, raw or compressed); it has /words (std_msgs/String as ros1)"
    )


def test_a_message_that_cannot_be_read_says_why(tmp_path):
    good = full(*COLOUR)

    def make(store):
        wide = bags.raw(store, 1.1, good, "rgb8")
        wide.width = 4000
        cut = bags.jpeg(store, 1.2, good)
        cut.data = cut.data[:30]
        messages = [bags.raw(store, 1.0, good, "32FC1"), wide]
        return [(bags.START + k, bags.RAW, m) for k, m in enumerate(messages)]

    deep, wide = Bag(bags.write(tmp_path / "log.bag", {"/eye": make}), None)
    assert deep.reason.startswith(
        "the pixel format of this image is '32FC1'; known are rgb8, bgr8, 8UC3, rgba8"
    )
    assert wide.reason == (
        "a picture of 4000 x 20 px in rgb8 does not fit into 1800 bytes with rows of 90: "
        "correct the sizes that the camera's driver writes"
    )


def test_foxglove_messages_are_read(tmp_path):
    stamp = messages.Timestamp(sec=bags.START, nsec=250_000_000)
    pixels = np.ascontiguousarray(shade(1)[..., ::-1])
    raw = messages.RawImage(
        timestamp=stamp,
        width=WIDTH,
        height=HEIGHT,
        encoding="rgb8",
        step=3 * WIDTH,
        data=pixels.tobytes(),
    )
    png = cv2.imencode(".png", shade(2))[1].tobytes()
    packed = messages.CompressedImage(timestamp=stamp, format="png", data=png)
    path = bags.foxglove(tmp_path / "log.mcap", {"/raw": [raw], "/packed": [packed]})
    for topic, k in (("/raw", 1), ("/packed", 2)):
        (picture,) = Bag(path, topic)
        np.testing.assert_array_equal(picture.image, shade(k)[..., ::-1])


def test_a_message_of_noise_is_damaged(tmp_path):
    wrong = [b"\xff" * 50, b"\x12\xff\xff\xff\xff\x07"]  # a block of 2 GB that is not there
    path = bags.foxglove(tmp_path / "log.mcap", {"/eye": wrong})
    assert [p.reason for p in Bag(path, None)] == 2 * [
        "the message with this picture is cut off or damaged: copy or record the bag again"
    ]


def test_pictures_that_are_written_in_another_way_are_named(tmp_path):
    topics = {"/eye": ("foxglove.CompressedImage", [(1.0, b"{}")])}
    path = bags.write_mcap(tmp_path / "log.mcap", "json", "jsonschema", topics, profile="")
    with pytest.raises(ValueError) as refused:
        Bag(path, None)
    assert str(refused.value) == (
        f"{path}: this bag has no topic with pictures that can be read (sensor_msgs or "
        "foxglove, raw or compressed); it has /eye (foxglove.CompressedImage as json)"
    )


def test_without_a_stamp_the_time_of_recording_counts(tmp_path):
    def make(store):
        rows = [(10.0, 0.0), (10.2, 0.0), (10.3, 0.0)]
        return [(at, bags.RAW, bags.raw(store, s, full(77), "mono8")) for at, s in rows]

    bag = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make}), None)
    assert [p.time for p in bag] == pytest.approx([0.0, 0.2, 0.3])
    assert bag.rate == pytest.approx(2 / 0.3)


def test_a_cut_log_gives_what_is_in_it_and_says_so(tmp_path):
    path = bags.write(tmp_path / "log.mcap", {"/eye": lambda s: 20 * pictures()(s)})
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    bag = Bag(path, None)
    found = list(bag)
    assert 40 < len(found) < 100
    assert all(p.image is not None for p in found)
    assert bag.end.lost
    assert bag.rate == pytest.approx((bag.count - 1) / 0.35)  # without the index of its end
    assert bag.end.sentence.startswith(
        f"{path}: {len(found)} pictures, then this bag is damaged or incomplete"
    )


@pytest.mark.parametrize("form", ["log.bag", "log_db3", "log_mcap"])
def test_a_cut_bag_is_one_sentence(two, form):
    path = two(form)
    file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    content = file.read_bytes()
    for part in (0.05, 0.5, 0.9):
        file.write_bytes(content[: round(len(content) * part)])
        with pytest.raises(ValueError) as refused:
            list(Bag(path, "/left"))
        assert str(refused.value).startswith(
            f"{path}: this bag is damaged or incomplete: copy or record it again"
        )
        assert "\n" not in str(refused.value)


def test_the_missing_extra_is_named(two, monkeypatch):
    path = two("log.mcap")
    monkeypatch.setitem(sys.modules, "mcap.reader", None)
    with pytest.raises(ValueError) as refused:
        Bag(path, None)
    assert str(refused.value) == (
        f"{path}: bags are read by the package 'mcap', which is not installed: install "
        "servobench[ros]"
    )


@pytest.mark.parametrize(("length", "is_said"), [(1_000_000_001, True), (1_000_000_000, False)])
def test_a_record_of_more_than_a_gigabyte_is_not_read(tmp_path, length, is_said):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x03" + length.to_bytes(8, "little") + bytes(99))
    with pytest.raises(ValueError) as refused:
        Bag(path, None)
    assert ("exceeds limit" in str(refused.value)) is is_said, str(refused.value)


def test_the_rate_is_that_of_the_pictures_not_of_the_whole_recording(tmp_path):
    def make(store):
        rows = [(30.0 + k / 10, 0.0) for k in range(6)]
        return [(at, bags.RAW, bags.raw(store, s, full(77), "mono8")) for at, s in rows]

    def long(store):
        return [(at, bags.RAW, bags.raw(store, 0.0, full(77), "mono8")) for at in (0.0, 90.0)]

    bag = Bag(bags.write(tmp_path / "log.mcap", {"/eye": make, "/other": long}), "/eye")
    assert bag.rate == pytest.approx(10.0)

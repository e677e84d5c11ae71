from pathlib import Path

import cv2
import numpy as np
import pytest

from servo.mistake import Mistake
from servo.study import suites
from sim.files.picture_file import rgb
from tracking.exported import Got10kTracker
from tracking.sequences.sequence import check_truth, read_all, read_folder, source_of
from tracking.sequences.sources import Folder
from tracking.sequences.truth import Format
from tracking.sequences.video_file import Video
from tracking.types import Region

THERE = "folder, video file, bag, camera:NUMBER, or address such as rtsp://HOST/PATH"
RED = np.full((40, 60, 3), (10, 20, 200), np.uint8)  # BGR


def test_a_folder_is_read_in_order_whatever_its_pictures_are(tmp_path):
    cv2.imwrite(str(tmp_path / "b.png"), RED)
    cv2.imwrite(str(tmp_path / "a.png"), RED[..., 2])
    (tmp_path / "c.jpg").write_bytes(b"no picture")
    (tmp_path / "d.jpg").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("mine")
    grey, colour, *broken = Folder.of(tmp_path, rate=10.0)
    assert (grey.name, colour.name, colour.time) == ("a.png", "b.png", 0.1)
    assert grey.image[0, 0].tolist() == [200, 200, 200]
    assert colour.image[0, 0].tolist() == [200, 20, 10]
    assert [picture.image for picture in broken] == [None, None]
    with pytest.raises(ValueError):
        colour.image[0, 0] = 0


@pytest.mark.parametrize(
    ("names", "taken", "note"),
    [
        (["._1", "1", "thumb", "2"], ["1", "2"], "1, the first is thumb.png"),
        ([".hidden", "1", "2"], ["1", "2"], ""),
        (["1", "a", "b"], ["1", "a", "b"], ""),
        (["a", "b"], ["a", "b"], ""),
    ],
)
def test_hidden_pictures_and_those_without_a_number_are_left_out(tmp_path, names, taken, note):
    for name in names:
        cv2.imwrite(str(tmp_path / "x.png"), RED)
        (tmp_path / "x.png").rename(tmp_path / f"{name}.png")
    pictures = list(Folder.of(tmp_path))
    assert [p.name for p in pictures] == [f"{name}.png" for name in taken]
    sentence = f"pictures without a number in the name are left out: {note}"
    assert {p.notes for p in pictures} == {(sentence,) if note else ()}


@pytest.mark.parametrize(
    ("names", "many", "first"),
    [
        (["IMG_9", "IMG_10", "IMG_11", "IMG_15", "IMG_16", "IMG_18"], 4, "IMG_11.png"),
        (["a2_00", "a2_10", "a2_20", "a2_40"], 1, "a2_20.png"),  # every tenth picture
        (["IMG_9", "IMG_10", "IMG_11"], 0, ""),
        (["1", "4", "7", "10"], 0, ""),  # every third picture, all of them
        (["1000033", "1000068", "1000100", "1000140"], 0, ""),  # stamps
        (["a1", "b4", "c9"], 0, ""),
        (["1_1", "1_2", "2_7", "2_8"], 0, ""),
        (["x"], 0, ""),
    ],
)
def test_numbers_that_names_leave_out_are_said(tmp_path, names, many, first):
    for name in names:
        cv2.imwrite(str(tmp_path / f"{name}.png"), RED)
    pictures = list(Folder.of(tmp_path, rate=10.0))
    assert [p.time for p in pictures] == pytest.approx([0.1 * k for k in range(len(names))])
    sentence = (
        f"by the numbers in the names {many} pictures are missing, the first after {first}; each "
        "picture is still taken as one period after the one before"
    )
    assert {p.notes for p in pictures} == {(sentence,) if many else ()}


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 1), (4, 5, 3), (4, 5, 4)])
def test_every_number_of_channels_becomes_rgb(shape):
    assert rgb(np.full(shape, 7, np.uint8)).tolist() == np.full((4, 5, 3), 7).tolist()


def test_a_video_is_read_with_its_rate(tmp_path):
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 12.5, (60, 40))
    for _ in range(5):
        writer.write(RED)
    writer.release()
    pictures = list(Video.of(path))
    assert len(pictures) == Video.of(path).count == 5
    assert pictures[3].time == pytest.approx(3 / 12.5)
    np.testing.assert_allclose(pictures[0].image[20, 30], [200, 20, 10], atol=6)  # MJPG loses some


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gone", f"gone: there is no such source: give a {THERE}"),
        ("camera:x", "camera:x: a camera is given by its number, such as camera:0"),
        (
            ".",
            ".: there are no images in this folder: give one with JPEG, PNG, BMP, TIFF, WebP or PPM files",
        ),
        ("img_%03d.png", f"img_%03d.png: there is no such source: give a {THERE}"),
        ("file:///etc/passwd", f"file:///etc/passwd: there is no such source: give a {THERE}"),
        ("concat:a.mp4|b.mp4", f"concat:a.mp4|b.mp4: there is no such source: give a {THERE}"),
    ],
)
def test_what_is_no_source_is_refused(tmp_path, monkeypatch, text, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError) as refused:
        source_of(text, 30.0)
    assert str(refused.value) == message


def layout(folder, pictures, count, truths):
    (folder / pictures).mkdir(parents=True, exist_ok=True)
    for i in range(count):
        cv2.imwrite(str(folder / pictures / f"{i:04}.png"), RED)
    for name, lines in truths.items():
        (folder / name).write_text("\n".join(lines) + "\n")


def test_otb_and_vot_layouts_are_found(tmp_path):
    otb = {f"groundtruth_rect.{i}.txt": ["11,11,20,10"] * 3 for i in (1, 2)}
    layout(tmp_path / "two", "img", 3, otb)
    layout(tmp_path / "turned", "color", 2, {"groundtruth.txt": ["10,10,30,10,30,20,10,20"] * 2})
    (tmp_path / "empty").mkdir()
    found = read_all(tmp_path, 30.0)
    assert [s.name for s in found] == ["turned", "two-1", "two-2"]
    assert [s.source.count for s in found] == [2, 3, 3]
    for sequence in found:
        assert (sequence.region.width, sequence.region.height) == (20, 10)
        assert (sequence.start.x, sequence.start.y) == (20, 15)


@pytest.mark.parametrize("label", ["meta_info.ini", "absence.label"])
def test_got_10k_s_layout_is_found_and_its_boxes_count_from_1(tmp_path, label):
    """Its toolkit hands them to trackers as they are, so `Got10kTracker` gets the same numbers."""
    boxes = ["11.0000,11.0000,20.0000,10.0000"] * 3
    files = {"groundtruth.txt": boxes, label: ["0", "0", "0"]}
    layout(tmp_path / "GOT-10k_Val_000001", "", 3, files)
    (tmp_path / "list.txt").write_text("GOT-10k_Val_000001\n")
    (sequence,) = read_all(tmp_path, 30.0)
    assert (sequence.name, sequence.source.count) == ("GOT-10k_Val_000001", 3)
    assert (sequence.start.x, sequence.start.y) == (20, 15)
    tracker = Got10kTracker("frozen")
    tracker.init(np.zeros((100, 160, 3), np.uint8), (11.0, 11.0, 20.0, 10.0))
    np.testing.assert_allclose(sequence.region.corners(sequence.start), sequence.truth[0])
    assert tracker.update(np.zeros((100, 160, 3), np.uint8)).tolist() == [11.0, 11.0, 20.0, 10.0]


def test_a_sequence_that_begins_without_its_target_is_refused(tmp_path):
    layout(tmp_path / "late", "img", 2, {"groundtruth.txt": ["nan,nan,nan,nan", "9,9,9,9"]})
    with pytest.raises(
        ValueError, match=r"groundtruth\.txt: the first line has no outline of the target"
    ):
        read_folder(tmp_path / "late", 30.0)


def test_a_folder_without_sequences_is_refused(tmp_path):
    with pytest.raises(ValueError, match="there is no sequence"):
        read_all(tmp_path, 30.0)


def test_the_shared_sequences_are_read(shared_sequences):
    found = {s.name: s for s in read_all(shared_sequences, 30.0)}
    assert len(found) == 13
    assert int(np.isnan(found["tld_pedestrian3"].truth[:, 0, 0]).sum()) == 28
    assert found["otb_girl"].start.x == pytest.approx(56 + 31 / 2)
    assert found["vot13_car"].region.width == 57


TWO = {"groundtruth_rect.txt": ["11,11,20,10"] * 2}


@pytest.mark.parametrize(
    ("pictures", "truths", "message"),
    [
        (
            2,
            {},
            "{}: there are pictures in this folder, but no truth file: add one, such as "
            "groundtruth.txt or truth.csv, or leave this folder out",
        ),
        (
            0,
            TWO,
            "{}: there is a truth file in this folder, but no picture: add the pictures, or leave "
            "this folder out",
        ),
        (
            3,
            TWO,
            "{}/groundtruth_rect.txt: this truth has 2 lines for 3 pictures; it needs one for "
            "each, with nan where the target is absent",
        ),
        (1, TWO, "{}/groundtruth_rect.txt: this truth has 2 lines for 1 pictures; it needs one"),
    ],
)
def test_half_a_sequence_among_others_is_named(tmp_path, pictures, truths, message):
    layout(tmp_path / "good", "img", 2, TWO)
    layout(tmp_path / "half", "img", pictures, truths)
    with pytest.raises(ValueError) as refused:
        read_all(tmp_path, 30.0)
    assert str(refused.value).startswith(message.format(tmp_path / "half"))


def test_a_link_that_leads_nowhere_is_named_and_other_things_are_passed_over(tmp_path):
    layout(tmp_path / "good", "img", 2, TWO)
    (tmp_path / "notes").mkdir()
    (tmp_path / "README.md").write_text("mine")
    assert [s.name for s in read_all(tmp_path, 30.0)] == ["good"]
    (tmp_path / "moved").symlink_to("gone")
    with pytest.raises(ValueError, match="moved: this link is broken"):
        read_all(tmp_path, 30.0)


def test_the_folder_of_a_sequence_that_may_not_be_read_is_named(tmp_path, monkeypatch):
    layout(tmp_path / "good", "img", 2, TWO)
    layout(tmp_path / "secret", "img", 2, TWO)
    usual = Path.iterdir

    def iterdir(self):
        if self.name == "secret":
            raise PermissionError(13, "Permission denied")
        return usual(self)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    with pytest.raises(ValueError, match="secret: cannot read this folder: Permission denied"):
        read_all(tmp_path, 30.0)


def test_tlds_own_layout_is_read(tmp_path):
    layout(tmp_path, ".", 2, {"gt.txt": ["10,10,30,20", "NaN,NaN,NaN,NaN"], "init.txt": ["1"]})
    (sequence,) = read_all(tmp_path, 30.0)
    assert (sequence.region.width, sequence.region.height) == (20, 10)
    assert (sequence.start.x, sequence.start.y) == (20, 15)
    assert np.isnan(sequence.truth[1]).all()


def test_a_suite_may_name_the_format_of_its_truths(tmp_path):
    layout(tmp_path / "one", "img", 2, {"groundtruth.txt": ["30,20,50,30"] * 2})
    suite = tmp_path / "suite.toml"

    def entries(more):
        suite.write_text(f'[[sequences]]\npath = "one"\n{more}')
        return suites.suite(str(suite))[0]

    (entry,) = entries('truth_format = "tld"')
    assert entry.build(0).region == Region(20.0, 10.0)
    (other,) = entries('truth_format = "vot"')
    assert other.build(0).region == Region(50.0, 30.0)
    assert entry.describe() != other.describe()
    for more, message in (
        ("", "give the format of this truth: otb, vot or tld"),
        ('truth_format = "coco"', "suite.toml: sequences[0]: there is no truth format 'coco'"),
        (
            "truth_format = 3",
            "suite.toml: sequences[0].truth_format = 3: input should be a valid string",
        ),
        ('format = "tld"', "suite.toml: sequences[0]: there is no key 'format'"),
    ):
        with pytest.raises(Mistake) as refused:
            entries(more)
        assert message in str(refused.value)


def test_an_outline_of_the_first_picture_alone_is_no_sequence(tmp_path):
    layout(tmp_path / "one", "img", 3, {"groundtruth_rect.txt": ["11,11,20,10"]})
    with pytest.raises(ValueError) as refused:
        read_all(tmp_path / "one", 30.0)
    assert str(refused.value).endswith(
        "this truth has 1 lines for 3 pictures; it needs one for each, with nan where the target is "
        "absent"
    )
    source = source_of(str(tmp_path / "one"), 30.0)
    outline = np.zeros((1, 4, 2))
    check_truth(outline, source, "truth.txt", Format.VOT, start_is_enough=True)
    with pytest.raises(ValueError, match="this truth has 1 lines for 3 pictures"):
        check_truth(outline, source, "truth.txt", Format.VOT)

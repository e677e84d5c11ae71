"""A folder of files that no command can use: broken, lying, misplaced and oddly named ones."""

from __future__ import annotations

import json
import os
import shutil
import struct
import zlib
from pathlib import Path

import bags
import cv2
import numpy as np
from wrong_studies import STUDIES, SUITES

LONG = "n" * 300
ODD = os.fsdecode(b"\xff")
NAMES = {"{ODD}": ODD, "{LONG}": LONG, "{LINE}": "\n", "{ESC}": "\x1b", "{NUL}": "\0"}
"""What a command line of the lists writes for characters that TOML or a shell cannot have."""
SCENARIOS: dict[str, str | bytes] = {
    "open": "[run\n",
    "twice": "[run]\nseed = 1\nseed = 2\n",
    "binary": bytes(range(256)),
    "nul": b"[run]\nseed = 1\0\n",
    "utf16": "[run]\nseed = 1\n".encode("utf-16"),
    "latin": "# a gr\xfcn car\n[run]\nsed = 1\n".encode("latin-1"),
    "bom": b"\xef\xbb\xbf[run]\nsed = 1\n",
    "crlf": b"[run]\r\nsed = 1\r\n",
    "cr": b"[run]\rseed = 1\r",
    "deep": "a = " + "[" * 5000 + "]" * 5000 + "\n",
    "dotted": ".".join("a" * 3000) + " = 1\n",
    "nested": "a = " + "[" * 150 + "]" * 150 + "\n",
    "huge": b"#" * 2_000_000,
    "number": "[run]\nseed = 1" + "0" * 5000 + "\n",
    "date": "[run]\nduration = 2020-01-01\n",
    "nan": "[run]\nduration = nan\n",
    "hex": "[run]\nseed = 0xffffffffffffffff\n",
    "section": "run = 3\n",
    "plugin": "tracker = 'kams'\n",
    "array": "[[tracker]]\nkind = 'kams'\n",
    "one": "[disturbances]\nkind = 'board'\n",
    "kindless": "[[disturbances]]\nstart = 1\n",
    "unkind": "[[disturbances]]\nkind = 'wind'\n",
    "late": "[[disturbances]]\nkind = 'board'\n[[disturbances]]\nkind = 'board'\nstart = 'x'\n",
    "controls": '"a\\nb\\u001b[31m" = 1\n',
    "unseen": '"\\u202e\\u200b" = 1\n',
    "sweeps": "sweep = 3\n",
    "bound": "[expect]\nservo_rms_px = 'x'\n",
    "outcome": "[expect]\noutcome = 'WON'\n",
    "measure": "[expect]\nservo_rms = 3\n",
    "longkey": f"{'k' * 5000} = 1\n",
    "json": '{"run": {"seed": 1}}',
}


def place(folder: Path, ran: Path, study: Path, papers: Path) -> Path:
    """Fill a folder; the last three are folders that commands wrote, copied to be damaged."""
    _scenarios(folder)
    _pictures(folder)
    _logs(folder)
    _studies(folder)
    _results(folder, ran, study, papers)
    return folder


def _scenarios(folder: Path) -> None:
    for name, text in SCENARIOS.items():
        (folder / f"{name}.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    (folder / "empty.toml").touch()
    (folder / "folder.toml").mkdir()
    os.mkfifo(folder / "pipe.toml")
    for name, target in (("zero", "/dev/zero"), ("gone", "nowhere"), ("loop", "loop.toml")):
        (folder / f"{name}.toml").symlink_to(target)
    (folder / f"{ODD}.toml").write_text("[run]\nsed = 1\n")
    (folder / "a\nb.toml").write_text("[run]\nsed = 1\n")
    (folder / "\x1b[31m.toml").write_text("[run]\nsed = 1\n")
    (folder / "grün.toml").write_text("[run]\nsed = 1\n")
    (folder / "full").mkdir()
    (folder / "full" / "mine.txt").write_text("mine\n")
    (folder / "vacant").mkdir()
    (folder / "linked").symlink_to("full")
    (folder / "dangling").symlink_to("nowhere")
    (folder / "file").write_text("a file\n")
    os.mkfifo(folder / "pipe")


def png(width: int, height: int, body: bytes = b"\0" * 20) -> bytes:
    """A PNG whose header claims a size, whatever its pixels are."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(body))
        + chunk(b"IEND", b"")
    )


HEAD = "time_s,command_x_m_s,joint_x_m\n"
GOOD = HEAD + "".join(f"{k / 30},{k // 15 % 2 - 0.5},{abs(k % 30 - 15) / 60}\n" for k in range(90))
LOGS: dict[str, str | bytes] = {
    "log_empty.csv": "",
    "log_words.csv": "no log\n",
    "log_binary.csv": bytes(range(256)),
    "log_untimed.csv": "time,command_x_m_s\n0,1\n1,2\n",
    "log_backwards.csv": f"{HEAD}3,1,0\n2,0,1\n1,0,1\n",
    "log_short.csv": f"{HEAD}0,1,0\n1,0,1\n",
    "log_endless.csv": f"{HEAD}0,1,0\n1e18,0,1\n",
    "log_still.csv": f"{HEAD}0,0,0\n1,0,0\n2,0,0\n3,0,0\n",
    "log_nan.csv": f"{HEAD}0,1,0\nnan,0,1\n3,0,1\n",
    "log_words.parquet": "no log\n",
    "log_good.csv": GOOD,
    "log_semicolon.csv": GOOD.replace(",", ";").replace(".", ","),
    "log_ragged.csv": f"{HEAD}0,1,0\n1,0,5,1\n2,0,0\n",
    "log_mixed.csv": f"{HEAD}0,1,0\n1,off,1\n3,0,1\n",
    "log_foreign.csv": GOOD.replace("_x_", "_A6x_"),
    "log_twice.csv": GOOD.replace("time_s", "command_x_m_s,time_s", 1).replace("\n", "\n0,"),
    "log_huge.csv": f"{HEAD}0,1,0\n1,1e300,1\n3,0,1\n",
    "log_few.csv": f"{HEAD}0,1,0\n1,-1,1\n3,0,0\n",
    "log_positions.csv": GOOD.replace("command_x_m_s", "command_x_m", 1),
    "log_sign.csv": HEAD
    + "".join(f"{k / 30},{0.5 - k // 15 % 2},{abs(k % 30 - 15) / 60}\n" for k in range(90)),
}


def _logs(folder: Path) -> None:
    for name, text in LOGS.items():
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    (folder / "log_zero.csv").symlink_to("/dev/zero")
    (folder / "log_pipe.csv").symlink_to("pipe")


FALSE_VIDEOS = {
    "empty.mp4": b"",
    "noise.mp4": bytes(range(256)) * 40,
    "cut.mp4": b"\0\0\0\x18ftypisom\0\0\2\0isomiso2",
    "text.avi": b"this is no film\n",
    "riff.avi": b"RIFF\xff\xff\xff\xffAVI LIST",
    "ebml.mkv": b"\x1aE\xdf\xa3" + b"\xff" * 40,
    "bag.mp4": b"#ROSBAG V2.0\n" + b"\0" * 100,
    "two.mcap": b"\x89MCAP0\r\n" + b"\0" * 100,
    "file.db3": b"SQLite format 3\0" + b"\0" * 100,
    "list.mp4": b"ffconcat version 1.0\nfile secret.mp4\n",
    "list.m3u8": b"#EXTM3U\n#EXTINF:1,\nsecret.ts\n",
    "list.mpd": b"<?xml version='1.0'?><MPD/>\n",
    "drawing.svg": b"<svg xmlns='http://www.w3.org/2000/svg'/>\n",
    "page.html": b"<html></html>\n",
    "still.png": b"",
}


def _pictures(folder: Path) -> None:
    texture = np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8)
    good = cv2.imencode(".png", texture)[1].tobytes()
    for name, data in FALSE_VIDEOS.items():
        (folder / name).write_bytes(data or (good if name.endswith("png") else b""))
    broken = {
        "cut": good[: len(good) // 2],
        "hollow": b"",
        "words": b"no picture\n",
        "vast": png(60000, 60000),
        "flat": png(0, 10),
        "lying": b"GIF89a" + good,
    }
    for name, data in broken.items():
        (folder / f"pictures_{name}").mkdir()
        (folder / f"pictures_{name}" / "1.png").write_bytes(data)
    (folder / "bag_folder").mkdir()
    (folder / "bag_folder" / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    image = {
        "/left": (bags.RAW, [(1.0, b"\0\1\0\0")]),
        "/right": (bags.COMPRESSED, [(1.0, b"\0\1\0\0" + b"\0" * 20)]),
    }
    bags.write_mcap(folder / "eyes.mcap", "cdr", "ros2msg", image)
    bags.write_mcap(folder / "words.mcap", "cdr", "ros2msg", {"/words": (bags.TEXT, [(1.0, b"")])})
    (folder / "pictures_pipe").mkdir()
    os.mkfifo(folder / "pictures_pipe" / "1.png")
    (folder / "pictures_link").mkdir()
    (folder / "pictures_link" / "1.png").symlink_to("nowhere.png")
    (folder / "seq").mkdir()
    for i in range(3):
        (folder / "seq" / f"{i}.png").write_bytes(good)
    _truths(folder)


TRUTHS: dict[str, str | bytes] = {
    "words": "here it is\n",
    "void": "",
    "blank": "\n\n\n",
    "short": "10,10,20,20\n",
    "few": "1,2,3\n" * 3,
    "many": "1,2,3,4,5\n" * 3,
    "comma": "10,5;10,5;20,0;20,0\n" * 3,
    "flat": "10,10,-20,20\n" * 3,
    "absent": "nan,nan,nan,nan\n" * 3,
    "binary": bytes(range(256)),
    "utf16": ("10,10,20,20\n" * 3).encode("utf-16"),
    "endless": "10,10,20,20\n" * 3 + "1" * 9000 + ",1,1,1\n",
    "infinite": "1e999,10,20,20\n" * 3,
    "uneven": "10,10,20,20\n10,10\n10,10,20,20\n",
    "corners": "1,1,2,2,3,3\n" * 3,
    "good": "10,10,20,20\n" * 3,
}


def _truths(folder: Path) -> None:
    for name, text in TRUTHS.items():
        (folder / f"{name}.txt").write_bytes(text if isinstance(text, bytes) else text.encode())
    (folder / "huge.txt").touch()
    os.truncate(folder / "huge.txt", 30_000_000)
    (folder / "header.csv").write_text("a,b,c\n1,2,3\n")
    (folder / "names.csv").write_text("frame,x,y,w,h\n0,a,b,c,d\n")


def _results(folder: Path, ran: Path, study: Path, papers: Path) -> None:
    kinds = {
        "run": (ran, "report.json", "steps.parquet"),
        "sweep": (study, "study.json", "runs.sqlite"),
        "papers": (papers, "papers.json", "figures/one.png"),
    }
    spoilt = {
        "list": "[]",
        "null": "null",
        "number": "3",
        "cut": '{"a": ',
        "deep": "[" * 100_000,
        "bare": "{}",
        "nan": '{"version": NaN}',
        "words": "x",
    }
    for kind, (source, summary, _) in kinds.items():
        for name, text in spoilt.items():
            _copy(source, folder / f"{kind}_{name}")
            (folder / f"{kind}_{name}" / summary).write_text(text)
        _copy(source, folder / f"{kind}_bytes")
        (folder / f"{kind}_bytes" / summary).write_bytes(b"\xff\xfe\0")
        _copy(source, folder / f"{kind}_pipe")
        (folder / f"{kind}_pipe" / summary).unlink()
        os.mkfifo(folder / f"{kind}_pipe" / summary)
    for kind, (source, _, data) in kinds.items():
        for name, change in {"zero": b"", "cut": b"PAR1", "gone": None}.items():
            _copy(source, folder / f"{kind}_data_{name}")
            file = folder / f"{kind}_data_{name}" / data
            file.unlink() if change is None else file.write_bytes(change)
    _copy(ran, folder / "run_good")
    _odd_types(folder, ran, papers)
    for name, text in {"false": b"RRF3abcd", "tiny": b"R", "magic": b"RRF2", "none": b""}.items():
        (folder / f"{name}.rrd").write_bytes(text)
    for name in ("list", "null", "bare", "words", "versions"):
        (folder / f"bench_{name}").mkdir()
        text = spoilt.get(name, '{"version": 3, "rows": {}, "trackers": 4}')
        (folder / f"bench_{name}" / "study.json").write_text(text)
        (folder / f"bench_{name}" / ".lock").touch()


def _odd_types(folder: Path, ran: Path, papers: Path) -> None:
    for key in ("scenario", "measures", "versions", "outcome", "seed", "settings", "missed"):
        _copy(ran, folder / f"run_odd_{key}")
        file = folder / f"run_odd_{key}" / "report.json"
        told = json.loads(file.read_text())
        file.write_text(json.dumps(told | {key: [[{"x": None}]]}))
    for key, value in {"claims": [1], "versions": 3, "quick": "yes"}.items():
        _copy(papers, folder / f"papers_odd_{key}")
        file = folder / f"papers_odd_{key}" / "papers.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))


def _copy(source: Path, target: Path) -> None:
    shutil.copytree(source, target)


def _studies(folder: Path) -> None:
    for prefix, texts in (("study", STUDIES), ("suite", SUITES)):
        for name, text in texts.items():
            (folder / f"{prefix}_{name}.toml").write_text(text)


def spelled(word: str) -> str:
    """A word of a command line with the characters that it names."""
    for name, characters in NAMES.items():
        word = word.replace(name, characters)
    return word

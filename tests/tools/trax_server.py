"""A TraX server that follows a box by adding its speed, and servers that fail in one way each."""

import cmath
import math
import re
import sys
import time

given = sys.argv[1:]
usual = ["good", "4", "rectangle", "path", ""]
mode, version, regions, pictures, gives = given + usual[len(given) :]
SPEED = 2.0


def say(text):
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def answer(numbers, named=""):
    say(f'@@TRAX:state "{",".join(map(str, numbers))}" {named}')


if mode == "dies":
    sys.exit("no weights found")
if mode == "silent":
    time.sleep(60)
if mode == "raises":
    marks = "    ~~^~~\n           ^\n"
    sys.exit(f"Traceback (most recent call last):\n  in load\n    1 / 0\n{marks}no division by 0")
say("loading ...")
if mode == "writes":
    for _ in range(3):
        sys.stdout.write("." * (1 << 24))
    say("")
about = f'"trax.region={regions};" "trax.image={pictures};" "trax.name=a b"'
about += f' "trax.gives={gives}"' if gives else ""
say(f'@@TRAX:hello "trax.version={version}" {about}')
numbers, count = [], 0
for line in sys.stdin:
    kind, *words = re.findall(r'@@TRAX:\w+|(?<=")[^" ]+(?=")', line)
    if kind == "@@TRAX:quit":
        break
    for word in words:
        if word.startswith("m0,"):
            mask = word
        if re.fullmatch(r"m?[-\d.,]+", word):
            word = word.removeprefix("m")
            numbers = [float(number) for number in word.split(",")]
            count = -1
            break
    if version == "4" and kind == "@@TRAX:initialize":
        continue
    picture = words[0]
    begin = {"path": "file:///", "memory": "image:160;100;rgb;", "buffer": "data:image/png;"}
    assert picture.startswith(begin[pictures]), picture[:40]
    count += 1
    if count == 3 and mode == "crashes":
        sys.stderr.write("out of memory\n")
        sys.exit(3)
    if count == 3 and mode == "hangs":
        time.sleep(60)
    if count == 3 and mode == "leaves":
        say("@@TRAX:quit")
        break
    said = {
        "nonsense": '@@TRAX:state "here, or there"',
        "three": '@@TRAX:state "1,2,3"',
        "none": "@@TRAX:state",
        "nan": '@@TRAX:state "nan,1,2,3"',
        "hello": "@@TRAX:hello",
        "negative": '@@TRAX:state "1,2,-3,4"',
        "vanishes": '@@TRAX:state "1,2,1e-300,1e-300"',
        "wrong": '@@TRAX:state "m0,0,2,2,1,9"',
        "unsure": '@@TRAX:state "1,2,3,4" "confidence=high"',
        "empty": '@@TRAX:state "m5,5,2,2,4"',
        "lost": '@@TRAX:state "0"',
        "long": f'@@TRAX:state "{",".join(["42,30,72,30,72,50,42,50"] * 60_000)}"',
    }.get(mode)
    if mode == "echoes":
        said = f'@@TRAX:state "{mask}"'
    if count > 0 and said:
        say(said)
        continue
    moves = range(0, len(numbers), 2) if len(numbers) > 4 else [0]
    moved = [n + SPEED * count * (i in moves) for i, n in enumerate(numbers)]
    if mode == "turns":
        c, s = 0.8, 0.6  # by 36.9 degrees about the middle of 55, 40
        pairs = zip(numbers[::2], numbers[1::2], strict=True)
        around = [(x - 55, y - 40) for x, y in pairs]
        moved = [v for x, y in around for v in (55 + c * x - s * y, 40 + s * x + c * y)]
        moved = moved[4:] + moved[:4]  # in another order
    if mode == "turns_back":
        turn = cmath.exp(-1j * math.radians(10 * count))
        pairs = zip(numbers[::2], numbers[1::2], strict=True)
        turned = [turn * complex(x - 55, y - 40) + (55 + 40j) for x, y in pairs]
        moved = [part for point in turned for part in (point.real, point.imag)]
    if mode == "tilts" and count:
        moved[2] += 2
        moved[3] += 3
    answer(moved, "" if mode == "plain" else f'"confidence={0.9 if count < 5 else 0.1}"')
    if mode == "twice" and count == 1:
        answer(moved)
        time.sleep(0.2)
if mode == "stays":
    time.sleep(3600)  # until it is killed

"""Hidden robots, planted mistakes, recordings that must be refused and clean ones: what
`servobench preflight` says of each.

    python tests/benchmarks/preflight.py --robots 12 --mistakes 20 --seed 1000 --out /tmp/preflight

Films and lines are kept in the folder: the same command continues. Prints a line for each recording, then
the table of servo/RESULTS.md. Another seed gives other motions and robots.
"""

import argparse
import json
import os
import pickle
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.append(str(Path(__file__).parents[1] / "tools"))
from hidden_robot import STARTS, Film, Robot

from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.twin.compare import compare
from servo.twin.corrections import Kind, Smooth
from servo.twin.readings import kinematics
from servo.twin.robot_motion import continuous, smoothed
from servo.twin.verdict import Trust, believed_mount
from servo.twin.wiggle import swings
from tracking.sequences.sources import Picture

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
ARM = "arm_line"


@dataclass
class JointFilm(Film):
    """A film by the arm's camera, whose joints swing."""

    def joints(self, times):
        """Joint positions (n, k), and the names of their columns."""
        with Episode(load(ARM), seen=False) as episode:
            robot = episode.world.robot
            start = robot.joints(episode.world.data)
            names = [f"joint_{n}_{u}" for n, u in zip(robot.names, robot.units, strict=True)]
        grid = np.arange(-STARTS, self.seconds + STARTS + 0.01, 0.005)
        path = swings(("rad",) * len(names), grid, self.seed, 0.7)
        return start + np.stack([np.interp(times, grid, each) for each in path.T], axis=1), names

    def pose(self, times):
        q, names = self.joints(times)
        poses = kinematics(ARM, names, Path("log"))(q)
        R = Rotation.from_quat(poses[:, 3:])
        mount = Rotation.from_euler("xyz", [3, -4, 10], degrees=True)
        return (R * mount).as_matrix(), poses[:, :3] + R.apply([0.02, -0.03, 0.01])


@dataclass
class LoopFilm(Film):
    """The film of a closed loop of a scenario."""

    def _steps(self):
        changes = ["robot.kind=free", f"run.duration={self.seconds}", *self.changes]
        with Episode(load(self.scenario, changes)) as episode:
            return [(s.frame.time, s.frame.image, s.truth.T_world_camera) for s in episode]

    def pictures(self):
        for k, (at, image, _) in enumerate(self._steps()):
            yield Picture(f"frame {k}", at, image)

    def pose(self, times):
        at, _, poses = zip(*self._steps(), strict=True)
        turns = continuous(Rotation.from_matrix([p.rotation for p in poses]).as_quat())
        values = np.hstack([[p.translation for p in poses], turns])
        found = np.stack([np.interp(times, at, each) for each in values.T], axis=1)
        return Rotation.from_quat(found[:, 3:]).as_matrix(), found[:, :3]


def tracks_of(film, folder):
    """The film's points, kept in the folder."""
    key = f"{type(film).__name__}-{film.seed}-{film.seconds:g}-{film.scenario}-" + "-".join(
        f"{x:g}" for x in (*film.moves, film.size, film.dark, film.cut, film.rate)
    )
    path = folder / f"{key}.pkl"
    if not path.exists():
        half = path.with_suffix(f".{os.getpid()}.part")
        with half.open("wb") as file:
            pickle.dump(replace(film.tracks(), middles=[]), file)
        half.rename(path)
    return pickle.loads(path.read_bytes())


@dataclass
class Case:
    """A recording: its film, its robot, and what is wrong with it."""

    name: str
    film: Film
    robot: Robot
    kind: Kind = Kind.POSES
    log: list = field(default_factory=list)
    """Functions that spoil the values of the log, in order."""
    spoil: list = field(default_factory=list)
    """Functions that spoil the points of the film."""
    focal: float = 1.0
    """True over given focal length; the lever along the axis is then known."""
    mount: tuple = ()
    names: tuple = ()
    """What must be named: for each mistake the texts of which one must be there."""
    refused: tuple = ()
    other: Film | None = None
    """The film, if it is of another motion than the log."""


def twists_of(times, values):
    """Twists (n, 6) of poses (n, 7) in the hand's frame."""
    R = Rotation.from_quat(values[:, 3:])
    dt = np.diff(times)[:, None]
    w = (R[:-1].inv() * R[1:]).as_rotvec() / dt
    v = R[:-1].inv().apply(np.diff(values[:, :3], axis=0)) / dt
    return (times[1:] + times[:-1]) / 2, np.hstack([v, w])


def smooth_of(case):
    """The log of a case, as `preflight` has it."""
    robot, film = case.robot, case.film
    poses_of, names = None, POSE
    if case.kind is Kind.JOINTS:
        rng = np.random.default_rng(robot.seed)
        times = np.arange(-1.0, film.seconds + 1.0, 1 / robot.rate)
        values, names = film.joints(times)
        values = values + rng.normal(0, 2e-4, values.shape)
        times = times + robot.offset
        poses_of = kinematics(ARM, names, Path("log"))
    else:
        exact = case.kind is Kind.TWISTS
        quiet = replace(robot, position_noise=0.0, turn_noise=0.0, jitter=0.0) if exact else robot
        times, values = quiet.log(film)
        if exact:
            rng = np.random.default_rng(robot.seed)
            base = Rotation.from_quat(values[:-1, 3:])
            times, values = twists_of(times, continuous_poses(values))
            values = values + rng.normal(0, 1, values.shape) * ([3e-3] * 3 + [6e-3] * 3)
            case = replace(case, log=[lambda v, f=f: f(v, base) for f in case.log])
    for spoil in case.log:
        values = spoil(values)
    if case.kind is Kind.POSES:
        values = continuous_poses(values)
    grid, even = smoothed(times, values)
    return Smooth(case.kind, grid, even, tuple(names), poses_of)


def continuous_poses(values):
    """Poses with quaternions of continuous signs."""
    return np.hstack([values[:, :3], continuous(values[:, 3:])])


def compared(case, folder):
    """The comparison of a case."""
    tracks = tracks_of(case.other or case.film, folder)
    # Wrong intrinsics: x_given = x_true f_true / f_given.
    tracks = replace(
        tracks,
        before=tracks.before * case.focal,
        after=tracks.after * case.focal,
        focal=tracks.focal / case.focal,
    )
    for spoil in case.spoil:
        tracks = spoil(tracks)
    believed = believed_mount(case.mount) if case.mount else None
    trust = Trust(focal=True, believed=believed)
    if case.focal != 1.0:
        trust = Trust(along=float(case.robot.rotation.inv().apply(case.robot.lever)[2]))
    return compare(smooth_of(case), tracks, trust, lambda _: None)


def true_robot(case):
    """The robot whose mount and offset the truth are."""
    if case.kind is Kind.JOINTS:
        mount = Rotation.from_euler("xyz", [3, -4, 10], degrees=True)
        return replace(case.robot, rotation=mount, lever=np.array([0.02, -0.03, 0.01]))
    return case.robot


def line_of(case, folder):
    """Compare a case; return what was found, beside the truth."""
    begun = time.process_time()
    found = compared(case, folder)
    verdict = found.verdict
    errors = true_robot(case).errors(found.fits.mount)
    bad = [each for each in verdict.findings if not each.is_good]
    text = " || ".join(f"{each.what}: {each.found}" for each in bad)
    line = {
        "name": case.name,
        "seconds": time.process_time() - begun,
        "good": verdict.is_good,
        "offset_ms": 1e3 * (found.fits.offset.value - true_robot(case).offset),
        "offset_half_ms": 1e3 * found.fits.offset.half,
        "errors": [*(1e3 * errors[:1]), *np.degrees(errors[1:4]), *(1e3 * errors[4:])],
        "halves": [
            1e3 * found.fits.mount.halves[0],
            *np.degrees(found.fits.mount.halves[1:4]),
            *(1e3 * found.fits.mount.halves[4:7]),
        ],
        "focal": found.fits.mount.focal / case.focal - 1,
        "depth": found.fits.offset.depth,
        "costs": [
            found.fits.diagnosis.as_it_is.cost,
            found.fits.diagnosis.best.cost,
            found.fits.diagnosis.floor,
        ],
        "share": found.fits.diagnosis.best.share,
        "scatter": found.fits.mount.scatter,
        "stray": found.fits.mount.stray,
        "has": [verdict.offset is not None, verdict.has_rotation, verdict.has_lever],
        "bad": text,
        "doubts": verdict.doubts,
    }
    line["named"] = all(any(text_ in text for text_ in each) for each in case.names)
    claims = [*line["has"][:1], *[line["has"][1]] * 3, *[line["has"][2]] * 3]
    line["covered"] = [abs(e) <= h for e, h in zip(line["errors"], line["halves"], strict=True)]
    if not line["has"][1]:
        line["covered"][0] = abs(line["offset_ms"]) <= line["offset_half_ms"]
    line["wrong"] = [k for k, claim in enumerate(claims) if claim and not line["covered"][k]]
    line["refused"] = all(
        not line["has"][("offset", "mount", "lever").index(x)] for x in case.refused
    )
    return {key: plainly(value) for key, value in line.items()}


def plainly(value):
    """A value for JSON."""
    if isinstance(value, list):
        return [plainly(each) for each in value]
    return (
        round(float(value), 4)
        if isinstance(value, float | np.floating)
        else (bool(value) if isinstance(value, np.bool_) else value)
    )


def robots(count, seed):
    """Hidden robots, each with a film of its own; every second one has a wrong focal length."""
    for k in range(count):
        rng = np.random.default_rng([seed + k, 11])
        focal = 1.0 if k % 2 == 0 else 1 + rng.uniform(0.03, 0.1) * rng.choice([-1, 1])
        film, robot = Film(seed=seed + 100 + k), Robot.drawn(seed + 200 + k)
        yield Case(f"robot {k}", film, robot, focal=focal)


# The spoilers: what a user's program does wrong.
def columns(*order):
    return lambda v: v[:, list(order)]


def scaled(which, factor):
    return lambda v: v * np.where(np.isin(np.arange(v.shape[1]), which), factor, 1.0)


def inverse(v):
    back = Rotation.from_quat(v[:, 3:]).inv()
    return np.hstack([-back.apply(v[:, :3]), back.as_quat()])


def mirrored(tracks):
    return replace(tracks, before=tracks.before * (-1, 1), after=tracks.after * (-1, 1))


def upside_down(tracks):
    return replace(tracks, before=-tracks.before, after=-tracks.after)


def at_rate(factor):
    return lambda tracks: replace(tracks, times=tracks.times * factor)


def in_base(v, base):
    return np.hstack([base.apply(v[:, :3]), base.apply(v[:, 3:])])


def v_in_base(v, base):
    return np.hstack([base.apply(v[:, :3]), v[:, 3:]])


def w_in_base(v, base):
    return np.hstack([v[:, :3], base.apply(v[:, 3:])])


def turned(v):
    """Poses whose position is in a frame of its own."""
    return np.hstack([Rotation.from_rotvec([0.2, 0.4, -0.4]).apply(v[:, :3]), v[:, 3:]])


def twist(change):
    return lambda v, base: change(v)


def stated(robot, turn=(0.0, 0.0, 0.0)):
    """The mount as its user states it, turned."""
    believed = robot.rotation * Rotation.from_euler("xyz", turn, degrees=True).inv()
    return (*robot.lever, *believed.as_euler("xyz", degrees=True))


MIRROR = ("mirrored", "wrong sign in all axes")


def mistakes(count, seed):
    """Planted mistakes, the most usual ones first."""
    film = [Film(seed=seed + 100 + k) for k in range(6)]
    r = [Robot.drawn(seed + 300 + k) for k in range(40)]
    arm = JointFilm(seed=seed + 50)
    order_w = columns(0, 1, 2, 6, 3, 4, 5)
    signed = "sign of {} of the position"
    cases = [
        ("quaternion order", {"log": [order_w], "names": [("w, x, y, z",)]}),
        ("inverse pose", {"log": [inverse], "names": [("inverse",)]}),
        ("millimetres", {"log": [scaled([0, 1, 2], 1e3)], "names": [("millimetres",)]}),
        ("sign of x", {"log": [scaled([0], -1)], "names": [(signed.format("x"),)]}),
        ("mirrored", {"spoil": [mirrored], "names": [MIRROR]}),
        ("upside down", {"spoil": [upside_down], "stated": (0, 0, 0), "names": [("upside down",)]}),
        (
            "mount 90 about z",
            {"stated": (0, 0, 90), "names": [("90 deg about its z", "90 deg about its -z")]},
        ),
        (
            "degrees",
            {
                "kind": Kind.TWISTS,
                "log": [twist(scaled([3, 4, 5], 57.2958))],
                "names": [("in degrees",)],
            },
        ),
        (
            "angular first",
            {
                "kind": Kind.TWISTS,
                "log": [twist(columns(3, 4, 5, 0, 1, 2))],
                "names": [("angular part",)],
            },
        ),
        (
            "base frame",
            {"kind": Kind.TWISTS, "log": [in_base], "names": [("v and w are in the base",)]},
        ),
        ("v in base", {"kind": Kind.TWISTS, "log": [v_in_base], "names": [("v is in the base",)]}),
        ("joint's sign", {"kind": Kind.JOINTS, "joint": 1, "names": [("sign of joint_",)]}),
        ("focal length 15 %", {"focal": 1.15, "names": [("focal length",)]}),
        (
            "axes cyclic",
            {"log": [columns(1, 2, 0, 3, 4, 5, 6)], "names": [("axes of the position",)]},
        ),
        ("rate 25 for 30", {"spoil": [at_rate(1.2)], "names": [("times run",)]}),
        ("clock drift", {"spoil": [at_rate(1.003)], "names": [("clock drift",)]}),
        (
            "order and sign",
            {"log": [order_w, scaled([1], -1)], "names": [("w, x, y, z",), (signed.format("y"),)]},
        ),
        (
            "degrees and mirrored",
            {
                "kind": Kind.TWISTS,
                "log": [twist(scaled([3, 4, 5], 57.2958))],
                "spoil": [mirrored],
                "names": [("in degrees",), (*MIRROR, "sign")],
            },
        ),
        (
            "inverse and millimetres",
            {"log": [scaled([0, 1, 2], 1e3), inverse], "names": [("inverse",), ("millimetres",)]},
        ),
        (
            "v axes and w's sign",
            {
                "kind": Kind.TWISTS,
                "log": [twist(columns(1, 0, 2, 3, 4, 5)), twist(scaled([5], -1))],
                "names": [("axes of v", "sign of", "axes x")],
            },
        ),
        (
            "sign of z of quaternion",
            {"log": [scaled([5], -1)], "names": [("sign of z of the quaternion",)]},
        ),
        ("all signs of position", {"log": [scaled([0, 1, 2], -1)], "names": [MIRROR]}),
        (
            "quaternion inverse",
            {
                "log": [scaled([3, 4, 5], -1)],
                "names": [("quaternion's vector has the wrong sign", "exchanged in position and")],
            },
        ),
        (
            "x and y exchanged",
            {
                "log": [columns(1, 0, 2, 4, 3, 5, 6)],
                "names": [("exchanged in position and", "quaternion's vector has the wrong sign")],
            },
        ),
        (
            "axes of position swapped",
            {"log": [columns(0, 2, 1, 3, 4, 5, 6)], "names": [("axes of the position",)]},
        ),
        ("mount 180 about x", {"stated": (180, 0, 0), "names": [("180 deg about its x",)]}),
        (
            "mount 90 about y",
            {"stated": (0, 90, 0), "names": [("90 deg about its y", "90 deg about its -y")]},
        ),
        (
            "v's sign of z",
            {"kind": Kind.TWISTS, "log": [twist(scaled([2], -1))], "names": [("sign of z of v",)]},
        ),
        (
            "w's axes",
            {
                "kind": Kind.TWISTS,
                "log": [twist(columns(0, 1, 2, 4, 3, 5))],
                "names": [("axes of w",)],
            },
        ),
        (
            "twist of the base",
            {
                "kind": Kind.TWISTS,
                "log": [twist(scaled(range(6), -1))],
                "names": [("of the base in the hand",)],
            },
        ),
        ("joint's degrees", {"kind": Kind.JOINTS, "degrees": True, "names": [("in degrees",)]}),
        ("focal length 12 % short", {"focal": 0.88, "names": [("focal length",)]}),
        (
            "drift and sign",
            {
                "log": [scaled([0], -1)],
                "spoil": [at_rate(0.998)],
                "names": [("clock drift",), (signed.format("x"),)],
            },
        ),
        ("rate 30 for 25", {"spoil": [at_rate(25 / 30)], "names": [("times run",)]}),
        (
            "w in base",
            {"kind": Kind.TWISTS, "log": [w_in_base], "names": [("and w in the base's",)]},
        ),
        (
            "position in another frame",
            {"log": [turned], "names": [("turned against",)]},
        ),
        (
            "v in base and degrees",
            {
                "kind": Kind.TWISTS,
                "log": [v_in_base, twist(scaled([3, 4, 5], 57.2958))],
                "names": [("v is in the base",), ("in degrees",)],
            },
        ),
        (
            "w in base and angular first",
            {
                "kind": Kind.TWISTS,
                "log": [w_in_base, twist(columns(3, 4, 5, 0, 1, 2))],
                "names": [("and w in the base's",), ("angular part",)],
            },
        ),
        (
            "position in another frame and quaternion order",
            {"log": [turned, order_w], "names": [("turned against",), ("w, x, y, z",)]},
        ),
    ]
    for k, (name, of) in enumerate(cases[:count]):
        of = dict(of)
        robot = r[k]
        place = of.pop("stated", None)
        if place is not None:
            of["mount"] = stated(robot, place)
        joint = of.pop("joint", None)
        if joint is not None:
            of["log"] = [scaled([joint], -1)]
        if of.pop("degrees", False):
            of["log"] = [lambda v: v * 57.2958]
        here = arm if of.get("kind") is Kind.JOINTS else film[k % len(film)]
        yield Case(name, here, robot, **of)


def refused(seed):
    """Recordings that cannot answer."""
    r = [Robot.drawn(seed + 400 + k) for k in range(12)]
    one, only = (1.0, 0, 0, 0, 0, 0), (1.0, 1.0, 1.0, 0, 0, 0)
    yield Case("one slide", Film(seed + 500, 20, moves=one), r[0], refused=("mount", "lever"))
    yield Case(
        "one turn",
        Film(seed + 501, 20, moves=(0, 0, 0, 0, 0, 1.0)),
        r[1],
        refused=("mount", "lever"),
    )
    yield Case("slides only", Film(seed + 502, 20, moves=only), r[2], refused=("lever",))
    yield Case(
        "turns only", Film(seed + 503, 20, moves=(0, 0, 0, 1.0, 1.0, 1.0)), r[3], refused=("lever",)
    )
    yield Case("four seconds", Film(seed + 504, 4.5), r[4], refused=("mount", "lever"))
    film = Film(seed + 505, 20)
    yield Case(
        "film of another motion",
        film,
        r[5],
        other=Film(seed + 506, 20),
        refused=("offset", "mount", "lever"),
    )
    yield Case(
        "closed loop, line",
        LoopFilm(seed + 507, 14, scenario="line"),
        r[6],
        refused=("mount", "lever"),
    )
    yield Case(
        "closed loop, circle",
        LoopFilm(seed + 508, 14, scenario="circle"),
        r[7],
        refused=("mount", "lever"),
    )
    yield Case("dark", Film(seed + 509, 20, dark=0.02), r[8], refused=("mount", "lever"))
    yield Case(
        "hardly any motion", Film(seed + 510, 20, size=0.01), r[9], refused=("mount", "lever")
    )


def clean(seed):
    """Clean recordings of other kinds."""
    r = [Robot.drawn(seed + 600 + k) for k in range(12)]
    yield Case("20 s", Film(seed + 601, 20), r[0])
    yield Case("log at 50 Hz", Film(seed + 602, 30), replace(r[1], rate=50.0))
    yield Case("log at 250 Hz", Film(seed + 603, 30), replace(r[2], rate=250.0))
    yield Case(
        "no noise",
        Film(seed + 604, 30),
        replace(r[3], position_noise=0.0, turn_noise=0.0, jitter=0.0),
    )
    yield Case(
        "noisy log", Film(seed + 605, 30), replace(r[4], position_noise=1e-3, turn_noise=2e-3)
    )
    yield Case("15 pictures a second", Film(seed + 606, 40, rate=15), r[5])
    yield Case("half as bright", Film(seed + 607, 30, dark=0.5), r[6])
    yield Case("smaller motion", Film(seed + 608, 40, size=0.6), r[7])
    yield Case("twists", Film(seed + 101), r[8], kind=Kind.TWISTS)
    yield Case("joints", JointFilm(seed=seed + 50), r[9], kind=Kind.JOINTS)


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def summary(lines):
    """The table of servo/RESULTS.md."""
    rows = [("what", "wanted", "reached")]
    of = {
        part: [x for x in lines if x["part"] == part]
        for part in ("robots", "mistakes", "refused", "clean")
    }
    good = [x for x in of["robots"] if x["has"][2]]
    if good:
        errors = np.array([x["errors"] for x in good])
        halves = np.array([x["halves"] for x in good])
        covered = np.where(halves > 0, abs(errors) <= halves, np.nan)  # a known lever has none
        errors = np.where(halves > 0, errors, np.nan)
        stage = np.array([[x["offset_ms"], x["offset_half_ms"]] for x in good])
        rows += [
            ("hidden robots with an answer", "", f"{len(good)} of {len(of['robots'])}"),
            (
                "offset by the flow alone",
                "",
                f"{rms(stage[:, 0]):.2f} ms rms, interval covers {np.mean(abs(stage[:, 0]) <= stage[:, 1]):.0%}",
            ),
            (
                "offset",
                "1 ms rms, 90 %",
                f"{rms(errors[:, 0]):.2f} ms rms, {np.nanmean(covered[:, 0]):.0%}",
            ),
            (
                "rotation of the mount, each axis",
                "0.3 deg, 90 %",
                f"{rms(errors[:, 1:4]):.2f} deg rms, {np.nanmean(covered[:, 1:4]):.0%}",
            ),
            (
                "lever, each axis",
                "6 mm, 90 %",
                f"{rms(errors[:, 4:]):.1f} mm rms, {np.nanmean(covered[:, 4:]):.0%}",
            ),
            (
                "false alarms among them",
                "0",
                str(sum(not x["good"] and "focal length" not in x["bad"] for x in of["robots"])),
            ),
        ]
    rows.append(
        (
            "planted mistakes named",
            "all",
            f"{sum(x['named'] for x in of['mistakes'])} of {len(of['mistakes'])}",
        )
    )
    right = sum(x["refused"] and not x["wrong"] for x in of["refused"])
    rows.append(
        (
            "refused as they must be, nothing wrong claimed",
            "all",
            f"{right} of {len(of['refused'])}",
        )
    )
    rows.append(
        (
            "clean ones without alarm",
            "all",
            f"{sum(x['good'] for x in of['clean'])} of {len(of['clean'])}",
        )
    )
    return "\n".join("| " + " | ".join(row) + " |" for row in (*rows[:1], ("---",) * 3, *rows[1:]))


def cases(given):
    """All recordings that are asked for, by their part of the table."""
    return {
        "robots": list(robots(given.robots, given.seed)),
        "clean": list(clean(given.seed))[: given.clean],
        "mistakes": list(mistakes(given.mistakes, given.seed)),
        "refused": list(refused(given.seed))[: given.refused],
    }


def judged(given, part, number):
    """The line of a recording; a worker makes the recording again, whose functions cannot be sent."""
    return {"part": part, **line_of(cases(given)[part][number], given.out)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=12)
    parser.add_argument("--mistakes", type=int, default=20)
    parser.add_argument("--refused", type=int, default=10)
    parser.add_argument("--clean", type=int, default=10)
    parser.add_argument("--only", default="", help="part of the names of recordings")
    parser.add_argument("--seed", type=int, default=0, help="other motions and robots")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("/tmp/preflight"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "lines.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {(line["part"], line["name"]) for line in lines}
    left = [
        (part, number)
        for part, every in cases(given).items()
        for number, case in enumerate(every)
        if given.only in case.name and (part, case.name) not in done
    ]
    with path.open("a") as file, ProcessPoolExecutor(given.workers) as pool:
        for future in as_completed([pool.submit(judged, given, *which) for which in left]):
            line = future.result()
            lines.append(line)
            file.write(json.dumps(line) + "\n")
            file.flush()
            print(json.dumps(line), flush=True)  # noqa: T201
    print(summary(lines))  # noqa: T201


if __name__ == "__main__":
    main()

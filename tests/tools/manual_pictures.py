"""Draw pictures of the manuals anew: python tests/tools/manual_pictures.py [NAME ...]."""

import itertools
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import gymnasium
import numpy as np
import photographed
from matplotlib import pyplot as plt
from PIL import Image

import servo
from servo.bench.benchmark import Band, load
from tracking.drawing import colours
from tracking.drawing.contact_sheet import outline

PICTURES = Path("scenes/pictures")
TUTORIALS = Path("servo/tutorials/pictures")
BLUE = "#1f5fa8"
RED = "#c03020"
GREY = "#5c6570"
SHOWN_WORLD = 25
"""Number of the world of goal-v1 that is shown of each condition."""


def saved(figure: plt.Figure, name: str, folder: Path = PICTURES) -> None:
    """Write a figure of 8 inches as a picture of 880 px."""
    figure.savefig(folder / name, dpi=110, pil_kwargs={"quality": 85})
    plt.close(figure)


def shown(ax: plt.Axes, image: np.ndarray, title: str) -> None:
    """Show a picture with a title, without axes."""
    ax.imshow(image)
    ax.set_title(title, fontsize=9)
    ax.axis("off")


def contrast() -> None:
    """The README's film: two trackers while a board hides the car, from just before it on."""
    runs = [f"occlusion --set tracker.kind={kind}" for kind in ("kams", "cv_mil")]
    with TemporaryDirectory() as folder:
        film = f"{folder}/film.mp4"
        command = [sys.executable, "-m", "servo", "film", *runs, "--out", film, "--quiet"]
        subprocess.run(command, check=True)
        with av.open(film) as pictures:
            every = [each.to_image() for each in pictures.decode(video=0)]
    first, *more = [each.resize((760, 749)) for each in every[75::4]]
    style = {"duration": 133, "loop": 0, "quality": 60, "method": 4}
    first.save(PICTURES / "film.webp", save_all=True, append_images=more, **style)


def hand_follow() -> None:
    """Three pictures of the run, and its error with and without an estimate."""
    errors = {}
    pictures = {}
    for kind in ("none", "kalman_cv"):
        errors[kind] = []
        with servo.Episode(servo.load("hand_follow", [f"estimator.kind={kind}"])) as episode:
            for step in episode:
                errors[kind].append(step.servo_error)
                if kind == "kalman_cv" and step.frame.index in (0, 60, 240):
                    image = step.frame.image.copy()
                    outline(image, step.goal.corners, colours.GOAL)
                    pictures[step.frame.time] = image[30:430, 80:560]
    figure, axes = plt.subplot_mosaic(
        [["0", "1", "2"], ["error"] * 3], figsize=(8, 4.4), layout="constrained"
    )
    for name, (time, image) in zip("012", pictures.items(), strict=True):
        shown(axes[name], image, f"{time:.0f} s, goal red")
    ax = axes["error"]
    for (kind, values), colour in zip(errors.items(), (RED, BLUE), strict=True):
        ax.plot(np.arange(len(values)) / 30, values, color=colour, label=f"estimator {kind}")
    ax.set(xlabel="time [s]", ylabel="held tag to its goal [px]", ylim=(0, 40), xlim=(0, 10))
    ax.legend(frameon=False)
    ax.grid(alpha=0.3)
    saved(figure, "hand_follow.jpg")


def environment() -> None:
    """What an environment gives over an episode: pictures, depths, and the reward's terms."""
    env = gymnasium.make(
        "servo.gym:servobench/DepthPlate-v0", observation="both", goal_picture=True
    )
    seen, info = env.reset(seed=0)
    goal = info["goal_picture"]
    now = [(0.0, seen["picture"], info["depth"])]
    terms = [info["reward_terms"].values()]
    rewards = [np.nan]
    over = False
    while not over:
        seen, reward, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
        over = terminated or truncated
        terms.append(info["reward_terms"].values())
        rewards.append(reward)
        if len(rewards) - 1 in (20, 120):
            now.append(((len(rewards) - 1) / 30, seen["picture"], info["depth"]))
    env.close()
    figure, axes = plt.subplot_mosaic(
        [["goal", "p0", "p1", "p2"], ["bar", "d0", "d1", "d2"], ["terms"] * 4],
        figsize=(8, 5.6),
        layout="constrained",
        height_ratios=(1.5, 1.5, 1.2),
    )
    shown(axes["goal"], goal, 'info["goal_picture"]')
    for k, (time, picture, depth) in enumerate(now):
        shown(axes[f"p{k}"], picture, f"observation, {time:.1f} s")
        drawn = axes[f"d{k}"].imshow(depth, cmap="viridis", vmin=0.7, vmax=1.3)
        axes[f"d{k}"].set_title('info["depth"]', fontsize=9)
        axes[f"d{k}"].axis("off")
    axes["bar"].axis("off")
    figure.colorbar(drawn, cax=axes["bar"].inset_axes((0.75, 0.1, 0.06, 0.8)), label="depth [m]")
    ax = axes["terms"]
    time = np.arange(len(rewards)) / 30
    for k, values in enumerate(np.array([list(t) for t in terms]).T, 1):
        ax.plot(time, values, color=GREY, lw=1, alpha=0.4 + 0.15 * k, label=f"corner_{k}_px")
    ax.set(xlabel="time [s]", ylabel="reward_terms [px]", xlim=(0, time[-1]))
    ax.set_ylim(bottom=0)
    ax.legend(frameon=False, fontsize=8, loc="center right")
    ax.grid(alpha=0.3)
    right = ax.twinx()
    right.plot(time, rewards, color=BLUE)
    right.set_ylim(0, 1)
    right.set_ylabel("reward", color=BLUE)
    saved(figure, "environment.jpg")


def box(ax: plt.Axes, at: tuple[float, float, float, float], title: str, text: str) -> None:
    """Draw a box (left, bottom, width, height) with a title and a text."""
    left, bottom, width, height = at
    ax.add_patch(plt.Rectangle((left, bottom), width, height, fc="#f4f6f8", ec=GREY))
    top = bottom + height - 0.12
    ax.text(left + 0.12, top, title, fontsize=9, fontweight="bold", va="top")
    ax.text(left + 0.12, top - 0.32, text, fontsize=8, va="top", linespacing=1.45)


def arrow(
    ax: plt.Axes, begin: tuple[float, float], end: tuple[float, float], text: str, kind: str = ""
) -> None:
    """Draw an arrow with a name above it, and a type or unit below it."""
    ax.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 1.3})
    middle = (np.add(begin, end) / 2).tolist()
    ax.text(middle[0], middle[1] + 0.05, text, fontsize=8, ha="center", va="bottom", color=BLUE)
    ax.text(middle[0], middle[1] - 0.06, kind, fontsize=7, ha="center", va="top", color=GREY)


def canvas(height: float) -> tuple[plt.Figure, plt.Axes]:
    """Return a figure whose units are inches."""
    figure = plt.figure(figsize=(8, height))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 8), ylim=(0, height))
    ax.axis("off")
    return figure, ax


def picture_in(ax: plt.Axes, image: np.ndarray, at: tuple[float, float], width: float) -> None:
    """Show a picture whose lower left corner is at a place."""
    tall = width * image.shape[0] / image.shape[1]
    ax.imshow(image, extent=(at[0], at[0] + width, at[1], at[1] + tall), zorder=2)
    ax.set(xlim=(0, 8), ylim=(0, ax.figure.get_figheight()), aspect="auto")


def ros2() -> None:
    """What travels between the two processes."""
    with servo.Episode(servo.load("circle", ["run.duration=1.0"])) as episode:
        *_, step = episode
    figure, ax = canvas(3.9)
    box(
        ax,
        (0.1, 0.15, 2.5, 3.6),
        "camera and robot",
        "yours, or for a trial\nservobench run circle --ros2",
    )
    picture_in(ax, step.frame.image, (0.25, 1.1), 2.2)
    note = "a picture of circle: rgb8, 320 x 240,\nstamp 0.967 s, frame_id camera"
    ax.text(0.25, 0.95, note, fontsize=7, va="top")
    box(
        ax,
        (5.5, 0.15, 2.4, 3.6),
        "controller",
        "servo.ros2.Camera\n    newest()  picture, depth\n    calibration()\nservo.ros2.Robot\n"
        "    posture(time)  joints at\n        the picture's stamp\n    go(twist)\nservo.Loop\n"
        "    step(frame, posture)\n\nor your own node",
    )
    topics = [
        ("/camera/image_raw", "sensor_msgs/Image"),
        ("/camera/depth/image_raw", "sensor_msgs/Image, 32FC1 [m]; of a depth camera"),
        ("/camera/camera_info", "sensor_msgs/CameraInfo"),
        ("/joint_states", "sensor_msgs/JointState [m, rad]"),
        ("/clock", "rosgraph_msgs/Clock; of run --ros2 only"),
    ]
    for k, (topic, kind) in enumerate(topics):
        arrow(ax, (2.65, 3.4 - 0.56 * k), (5.45, 3.4 - 0.56 * k), topic, kind)
    arrow(ax, (5.45, 0.5), (2.65, 0.5), "/servo/twist", "geometry_msgs/TwistStamped [m/s, rad/s]")
    saved(figure, "ros2.png")


def drivers() -> None:
    """What goes through a driver, with units and frames."""
    with servo.Episode(servo.load("arm_line", ["run.duration=1.0"])) as episode:
        *_, step = episode
    figure, ax = canvas(3.5)
    ax.text(0.1, 2.85, "camera", fontsize=9, fontweight="bold")
    picture_in(ax, step.frame.image, (0.1, 1.5), 1.6)
    ax.text(0.1, 1.4, "as arm_line renders it", fontsize=7, va="top")
    box(
        ax,
        (2.45, 0.15, 1.6, 3.2),
        "servo.Loop",
        "tracker:\n   x, y [px], theta [rad]\n"
        "estimator:\n   e and de/dt\n"
        "law:\n   twist v, w, in limits",
    )
    arrow(ax, (1.75, 2.1), (2.4, 2.1), "newest()", "RGB, [s]")
    box(
        ax,
        (5.0, 1.85, 2.9, 1.5),
        "ur_robot.py (ur_rtde)",
        "go   v_tcp = R (v + w x p), w_base = R w\n"
        "        speedL, base frame [m/s, rad/s]\n"
        "posture   getActualQ [rad]\n"
        "        getActualTCPSpeed [m/s, rad/s]",
    )
    box(
        ax,
        (5.0, 0.15, 2.9, 1.5),
        "lerobot_robot.py (LeRobot)",
        "go   goal + joint rates x period\n"
        "        send_action, positions [deg]\n"
        "posture, newest   get_observation\n"
        "        positions [deg], picture",
    )
    for bottom in (1.85, 0.15):
        arrow(ax, (4.1, bottom + 0.95), (4.95, bottom + 0.95), "go(twist)")
        arrow(ax, (4.95, bottom + 0.55), (4.1, bottom + 0.55), "", "posture()")
    note = (
        "twist: of the camera,\n   in its own frame [m/s, rad/s]\n"
        "posture: pose, twist, joints,\n   limits, Jacobian"
    )
    ax.text(0.1, 0.8, note, fontsize=7, va="top", color=BLUE)
    saved(figure, "drivers.png", TUTORIALS)


def photographs() -> None:
    """A drawn photograph of gravel with the sheet on it, straightened, and two scenarios."""
    with TemporaryDirectory() as folder:
        plane = photographed.gravel()
        plane = photographed.with_sheet(plane, photographed.printed(), 0.2)
        image, _ = photographed.photograph(plane, (0.12, -0.42, 0.62), blur=0.7, noise=4.0)
        Image.fromarray(image).save(f"{folder}/a.png")
        command = [sys.executable, "-m", "servo", "photo", "a.png", "--out", "b.png"]
        subprocess.run(command, check=True, cwd=folder)
        straight = np.asarray(Image.open(f"{folder}/b.png"))
    figure, axes = plt.subplots(1, 4, figsize=(8, 1.75), layout="constrained")
    shown(axes[0], image, "a photograph")
    shown(axes[1], straight, "straightened")
    for ax, name in zip(axes[2:], ("photo_plate", "photo_walls"), strict=True):
        large = ["camera.width=640", "camera.height=480", "run.duration=0.05"]
        step = next(iter(servo.run(servo.load(name, large))))
        shown(ax, step.frame.image, name)
    saved(figure, "photographs.jpg")


def goal_picture() -> None:
    """The picture at the goal, and the first and the last picture of the scenario."""
    with servo.Episode(servo.load("goal_picture", ["camera.renderer=exact"])) as episode:
        there = episode.goal_picture
        steps = list(episode)
    figure, axes = plt.subplots(1, 3, figsize=(8, 2.2), layout="constrained")
    pictures = there, steps[0].frame.image, steps[-1].frame.image
    names = "the picture at the goal", "the first picture", "the last picture"
    for ax, image, name in zip(axes, pictures, names, strict=True):
        shown(ax, image, name)
    saved(figure, "goal_picture.jpg")


HIDDEN_FRAME = 57
"""A frame in which boards stand before the target."""


def goal_worlds() -> None:
    """Of each condition of goal-v1 a world to tune on: the picture at the goal, and the first one."""
    benchmark = load("goal-v1")
    figure, axes = plt.subplots(6, 3, figsize=(8, 12.6), layout="constrained")
    for k, condition in enumerate(benchmark.conditions):
        world = benchmark.worlds_of(condition, Band())[SHOWN_WORLD]
        above, below = axes[2 * (k // 3) : 2 * (k // 3) + 2, k % 3]
        scenario = benchmark.scenario_of(world, benchmark.home["orb"])
        with servo.Episode(scenario) as episode:
            shown(above, episode.goal_picture, f"{condition.name}: at the goal")
            shown(below, next(iter(episode)).frame.image, "the first picture")
    saved(figure, "goal_worlds.jpg")


def loop_worlds() -> None:
    """Of each condition of loop-v2 a world to tune on, in the middle of the run, as the truth sees it."""
    benchmark = load("loop-v2")
    figure, axes = plt.subplots(4, 5, figsize=(10, 7.2), layout="constrained")
    for k, condition in enumerate(benchmark.conditions):
        world = benchmark.worlds_of(condition, Band())[k % 6]
        scenario = benchmark.scenario_of(world, benchmark.perfect)
        above, below = axes[2 * (k // 5) : 2 * (k // 5) + 2, k % 5]
        with servo.Episode(scenario) as episode:
            steps = itertools.islice(episode, HIDDEN_FRAME + 1)
            pictures = [step.frame.image for step in steps]
        shown(above, pictures[0], f"{condition.name}: at the start")
        shown(below, pictures[-1], f"after {HIDDEN_FRAME / scenario.camera.rate:.1f} s")
    saved(figure, "loop_worlds.jpg")


PARTS = (
    goal_picture,
    goal_worlds,
    loop_worlds,
    contrast,
    hand_follow,
    environment,
    photographs,
    ros2,
    drivers,
)
DRAWN = {one.__name__: one for one in PARTS}

if __name__ == "__main__":
    for name in sys.argv[1:] or DRAWN:
        DRAWN[name]()

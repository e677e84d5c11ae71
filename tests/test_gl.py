import os
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from machines import machine_with

from sim.camera import gl, renderer

pytestmark = pytest.mark.processes

INSTALL = (
    "'apt-get install --no-install-recommends libegl1 libgl1 libgl1-mesa-dri' (Debian, Ubuntu), "
    "'dnf install mesa-libEGL mesa-libGL mesa-dri-drivers' (Fedora) or 'pacman -S mesa' (Arch)"
)


@pytest.mark.parametrize(
    ("names", "device", "message"),
    [
        ((), True, f"The OpenGL library libEGL.so.1 is missing on this machine: run {INSTALL}."),
        (
            ("libEGL.so.1",),
            True,
            f"The OpenGL library libGL.so.1 is missing on this machine: run {INSTALL}.",
        ),
        (
            ("libEGL.so.1", "libGL.so.1"),
            False,
            f"No OpenGL driver answers on this machine (libEGL finds no device): run {INSTALL}.",
        ),
    ],
)
def test_what_is_missing_is_named_with_the_command_that_installs_it(
    monkeypatch, names, device, message
):
    machine_with(monkeypatch, *names, device=device)
    with pytest.raises(gl.NoRenderer) as missing:
        gl.backend()
    assert str(missing.value) == message


def test_a_complete_machine_uses_egl(monkeypatch):
    machine_with(monkeypatch, "libEGL.so.1", "libGL.so.1")
    assert gl.backend() == "egl"


@pytest.mark.opengl
def test_the_real_probe_agrees_that_this_machine_renders(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert gl.backend() in ("egl", "glfw")


def test_rendering_that_was_switched_off_says_so(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(
        gl.NoRenderer,
        match=r"^Rendering is switched off by the environment variable MUJOCO_GL=off: unset it\.$",
    ):
        gl.backend()


@pytest.mark.parametrize("broken", [True, False])
def test_without_a_screen_glfw_says_what_is_known(monkeypatch, broken):
    """Where it has no window, MuJoCo's context is none; or GLFW itself refuses."""

    def context(width, height):
        if broken:
            raise ImportError("Failed to load GLFW3 shared library.")
        return SimpleNamespace(_context=None)

    monkeypatch.setattr(gl.sys, "platform", "darwin")
    monkeypatch.setattr(gl.importlib, "import_module", lambda _: SimpleNamespace(GLContext=context))
    monkeypatch.setattr(gl, "KEPT", SimpleNamespace())
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(gl.NoRenderer) as refused:
        gl.call(int)
    why = "Failed to load GLFW3 shared library." if broken else "GLFW made no window"
    assert str(refused.value) == f"{gl.NO_CONTEXT} ({why})."


def first_picture(*changes):
    from servo.loop.episode import Episode
    from servo.scenario.load import load

    with Episode(load("still", list(changes))) as episode:
        return episode.world.look().image.copy()


@pytest.mark.opengl
def test_the_first_picture_does_not_depend_on_what_was_rendered_before():
    gl.call(gl.KEPT.__dict__.clear).result()
    alone = first_picture()
    first_picture("camera.width=640", "camera.height=480")
    first_picture("robot.kind=arm", "disturbances=[{kind='spot', start=0.0}]")
    assert np.array_equal(first_picture(), alone)


def test_worlds_that_are_open_at_the_same_time_draw_their_own_pictures():
    from servo.loop.episode import Episode
    from servo.scenario.load import load

    alone = [first_picture("start.x=30"), first_picture("camera.width=200", "camera.height=100")]
    with Episode(load("still", ["start.x=30"])) as a:
        with Episode(load("still", ["camera.width=200", "camera.height=100"])) as b:
            together = [e.world.look().image.copy() for e in (a, b)]
            assert all(map(np.array_equal, together, alone))
        assert np.array_equal(a.world.look().image, alone[0])  # b's buffers are gone


def test_several_threads_take_the_same_pictures():
    alone = first_picture()
    with ThreadPoolExecutor(2) as threads:
        for _ in range(2):
            for picture in threads.map(lambda _: first_picture(), range(4)):
                assert np.array_equal(picture, alone)


QUIET = {
    "no driver": (
        ["run", "still", "-q", "--no-rerun", "--set", "run.duration=0.1", "--set", "expect={}"],
        {"LIBGL_DRIVERS_PATH": "/nonexistent"},
        "servobench: No OpenGL driver answers on this machine (libEGL finds no device): run "
        f'{INSTALL}. camera.renderer = "exact" is used.\n',
        0,
    ),
    "no home": (
        ["report", "gone"],
        {"HOME": "/dev/null", "XDG_CONFIG_HOME": "", "XDG_CACHE_HOME": ""},
        "servobench: gone: there is no such folder: name one, or loop-v2 or loop-v2-size or loop-v2-all or servo-v2 or goal-v1 or loop-v1 or servo-v1 without --measures\n",
        2,
    ),
}


@pytest.mark.parametrize("case", [pytest.param("no driver", marks=pytest.mark.opengl), "no home"])
def test_libraries_write_nothing_before_the_sentence(tmp_path, case):
    arguments, variables, sentence, expected = QUIET[case]
    unset = ("MUJOCO_GL", "MPLCONFIGDIR", gl.WITHOUT)
    environment = {k: v for k, v in os.environ.items() if k not in unset} | variables
    code = "from servo.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], env=environment, capture_output=True, cwd=tmp_path
    )
    assert (done.returncode, done.stdout, done.stderr.decode()) == (expected, b"", sentence)


FORKS = """
import os, signal, sys
import servo
from servo.loop.episode import Episode

scenario = servo.load("still", ["tracker.kind=frozen"])
episode = Episode(scenario)
episode.world.look()
if os.fork() == 0:
    signal.alarm(60)  # it would wait for ever
    for world in (lambda: episode.world, lambda: Episode(scenario).world):
        try:
            print(world().look().image.shape, flush=True)
        except RuntimeError as error:
            print(error, flush=True)
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
"""


@pytest.mark.opengl
def test_a_fork_of_a_process_that_has_rendered_renders():
    others = {k: v for k, v in os.environ.items() if k != gl.MESA_THREADS}
    done = subprocess.run(
        [sys.executable, "-c", FORKS],
        env=others,
        capture_output=True,
        text=True,
        check=False,
    )
    now = [renderer.ELSEWHERE, "(240, 320, 3)"]
    assert (done.returncode, done.stdout.splitlines()) == (0, now), done.stderr


def test_a_world_takes_the_same_picture_in_another_thread():
    from servo.loop.episode import Episode
    from servo.scenario.load import load

    with Episode(load("still")) as episode, ThreadPoolExecutor(1) as threads:
        here = episode.world.look().image
        assert np.array_equal(threads.submit(episode.world.look).result().image, here)


@pytest.mark.opengl
def test_an_opengl_that_is_too_old_is_a_sentence():
    done = subprocess.run(
        [sys.executable, "-m", "servo", "doctor"],
        env=os.environ | {"MESA_GL_VERSION_OVERRIDE": "1.4"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert re.fullmatch(
        r"servobench: MuJoCo cannot render with the OpenGL of this machine \(.*, 1\.4 Mesa.*\): "
        r"OpenGL version 1\.5 or higher required; "
        r'set camera\.renderer = "exact"\.\n',
        done.stderr,
    )


INTERRUPTED = """
import threading
from sim.camera import gl

def interrupted(thread):
    start(thread)
    if threading.current_thread() is threading.main_thread():
        threading.Thread.start = start
        raise KeyboardInterrupt

start = threading.Thread.start
threading.Thread.start = interrupted
try:
    gl.call(int)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_a_process_ends_that_was_interrupted_while_the_rendering_thread_began():
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        capture_output=True,
        text=True,
        check=False,
        timeout=30.0,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted\n", "")


def test_a_run_is_closed_while_its_thread_asks_for_a_picture():
    """As the garbage collector does with a run that nobody holds: it must not wait for the lock."""
    from servo.loop.episode import run
    from servo.scenario.load import load

    abandoned = run(load("still", ["run.duration=0.2"]))
    next(abandoned)
    closing = threading.Thread(target=abandoned.close)
    with gl.rendering()._shutdown_lock:
        closing.start()
        closing.join(10.0)
        waits = closing.is_alive()
    closing.join()
    assert not waits

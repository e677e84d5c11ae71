"""The OpenGL that renderers share, and a plain sentence where this machine has none.

MuJoCo's wheel ships no OpenGL. Without one it fails deep inside, with messages that name the wrong
thing, so this file checks first.
"""

import ctypes
import functools
import importlib
import importlib.util
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from sim.stderr import silent_libraries

INSTALL = (
    "'apt-get install --no-install-recommends libegl1 libgl1 libgl1-mesa-dri' (Debian, Ubuntu), "
    "'dnf install mesa-libEGL mesa-libGL mesa-dri-drivers' (Fedora) or 'pacman -S mesa' (Arch)"
)
"""What brings OpenGL without a GPU."""
NO_SCREEN = (
    "GLFW made no OpenGL context. macOS and Windows bring OpenGL, but give it to a user who is "
    "logged in at the screen only, not over ssh or to a service; servobench is tested on Linux"
)
CHOSEN_BY = "MUJOCO_GL"
OFF = ("off", "disable", "disabled", "false", "0")
ANY = ("", "on", "enable", "enabled", "true", "1", "glfw")
NATIVE = {"linux": ("glx", "egl", "osmesa"), "win32": ("wgl",), "darwin": ("cgl",)}
"""Names of back ends that MuJoCo takes on every system, and on one."""
OSMESA = ("libOSMesa.so.8", "'apt-get install --no-install-recommends libosmesa6 libgl1'")
NO_WINDOW = 16
"""Side of a context's own buffer [px]: everything is rendered into buffers of MuJoCo's."""
KEPT = threading.local()
"""The GL context of a thread. To make one takes 0.2 s of CPU, so it is kept until the end of the
process; a context belongs to the thread that made it.
"""
RENDERING: dict[int, ThreadPoolExecutor] = {}
"""The thread that renders, by process: a forked one does not have its parent's."""
RETURNED: dict[int, SimpleQueue[Callable[[], object]]] = {}
"""What `call_later` was given since the last call, by process."""
Result = TypeVar("Result")

WITHOUT = "SERVOBENCH_WITHOUT_OPENGL"
"""Set where there is no OpenGL, and this was said: processes that are started say it no more."""
RASTERISERS = ("llvmpipe", "softpipe", "swrast")
"""How Mesa's rasterisers, which draw on the processor, call themselves."""
MESA_THREADS = "LP_NUM_THREADS"
"""Number of threads of Mesa's rasteriser. They do not survive a fork, and a child would wait for
them for ever, so by default there are none; pictures of 320 x 240 px lose no time by it."""
WITH_THREADS: set[int] = set()
"""The processes that had such threads when they were forked, from the first ancestor on."""
FORKED = (
    "This process was forked from one that has rendered with threads of Mesa's, which a fork does "
    f'not have: start processes with context="spawn", or unset {MESA_THREADS}.'
)


class NoRenderer(RuntimeError):
    """This machine cannot render off screen; the message says what to install."""


def backend() -> str:
    """The off-screen back end to use: 'egl' or 'osmesa' on Linux, 'glfw' elsewhere.

    Raises:
        NoRenderer: A library is missing, or the user switched rendering off.
    """
    os.environ.setdefault(MESA_THREADS, "0")  # Mesa reads it when libEGL is first asked
    asked = _asked()
    if asked in OFF:
        raise NoRenderer(f"Rendering is switched off by {CHOSEN_BY}={asked}: unset it.")
    if sys.platform != "linux":
        return "glfw"
    _load_triton()
    if asked == "osmesa":
        _require(*OSMESA)
        return "osmesa"
    _require("libEGL.so.1", INSTALL)
    if _library("libGL.so.1") is None:
        _require("libOpenGL.so.0", INSTALL)
    with silent_libraries():
        answers = _has_device()
    if not answers:
        raise NoRenderer(
            f"No OpenGL driver answers on this machine (libEGL finds no device): run {INSTALL}."
        )
    return "egl"


@functools.cache
def is_there() -> bool:
    """Return whether this machine has OpenGL; print a line where it has none."""
    try:
        backend()
        if sys.platform != "linux":  # it is known only when a context is made
            call(int).result()
    except NoRenderer as error:
        if WITHOUT not in os.environ:
            os.environ[WITHOUT] = "1"
            sys.stderr.write(f'servobench: {error} camera.renderer = "exact" is used.\n')
        return False
    return True


def check_environment() -> None:
    """Check what MuJoCo and PyOpenGL read when they are imported, and would fail on.

    Raises:
        NoRenderer: MUJOCO_GL names a back end that does not exist, or is not on this machine.
    """
    asked = _asked()
    if asked not in (*ANY, *OFF, *NATIVE.get(sys.platform, ())):
        raise NoRenderer(f"{CHOSEN_BY}={asked}: there is no such back end: unset it, or use egl.")
    if asked in ("egl", "osmesa"):
        _require(*OSMESA) if asked == "osmesa" else _require("libEGL.so.1", INSTALL)
    os.environ.pop("PYOPENGL_PLATFORM", None)  # MuJoCo sets it to its back end


def call(function: Callable[..., Result], *args: object) -> Future[Result]:
    """Run a function where this process's GL context is current, after all that was asked before.

    All that renders shares one thread, so that pictures are made while their reader works on
    others, and worlds may be used in any thread.

    Raises:
        NoRenderer: As for `backend`, or the process was forked from one with threads of Mesa's; by
            the result.
    """
    if sys.platform != "linux":  # GLFW makes contexts in the main thread only
        done: Future[Result] = Future()
        done.set_result(_with_context(function, *args))
        return done
    return rendering().submit(_with_context, function, *args)


def call_later(function: Callable[..., object], *args: object) -> None:
    """Run a function where this process's GL context is current, before the next call.

    It neither waits nor takes a lock: the garbage collector closes a run that nobody holds any
    more, in any thread, and also while that thread asks for a picture.
    """
    returned = RETURNED.setdefault(os.getpid(), SimpleQueue())
    returned.put(functools.partial(function, *args))


def rendering() -> ThreadPoolExecutor:
    """The thread of this process that makes pictures; a fork waits until it is idle."""
    return RENDERING.setdefault(os.getpid(), ThreadPoolExecutor(1, "rendering"))


def _with_context(function: Callable[..., Result], *args: object) -> Result:
    """Call a function; the first call in a thread makes its context, directly, so that nothing
    depends on MUJOCO_GL at the time mujoco was imported.
    """
    if not hasattr(KEPT, "context"):
        if WITH_THREADS - {os.getpid()}:
            raise NoRenderer(FORKED)
        KEPT.context = _new_context(backend())
        KEPT.context.make_current()
    returned = RETURNED.setdefault(os.getpid(), SimpleQueue())
    with suppress(Empty):
        while True:
            returned.get_nowait()()
    return function(*args)


def _new_context(name: str) -> Any:
    try:
        context: Any = importlib.import_module(f"mujoco.{name}").GLContext(NO_WINDOW, NO_WINDOW)
    except Exception as error:
        if name != "glfw":
            raise
        raise NoRenderer(f"{NO_SCREEN} ({error}).") from error
    if name == "glfw" and not context._context:  # without a screen GLFW gives no window
        raise NoRenderer(f"{NO_SCREEN}.")
    return context


def describe() -> str:
    """The name the OpenGL driver gives itself, and its version."""
    return call(_names).result()


def has_gpu() -> bool:
    """Return whether a GPU draws what OpenGL is asked for; Mesa's own rasterisers are none."""
    try:
        backend()
        return not describe().startswith(RASTERISERS)
    except NoRenderer:
        return False


def _names() -> str:
    opengl: Any = importlib.import_module("OpenGL.GL")
    names = (opengl.GL_RENDERER, opengl.GL_VERSION)
    return ", ".join(opengl.glGetString(name).decode() for name in names)


def finish() -> None:
    """Wait until all that was drawn is there. Python's other threads run meanwhile, which they do
    not while MuJoCo reads pixels.
    """
    if sys.platform == "linux":
        _finish()()


@functools.cache
def _finish() -> Callable[[], None]:
    library = _library("libOpenGL.so.0") or ctypes.CDLL("libGL.so.1")
    return library.glFinish


def _before_fork() -> None:
    """Wait until the rendering thread is idle, and note whether Mesa has threads."""
    if os.getpid() in RENDERING:
        with suppress(RuntimeError):  # the interpreter is shutting down
            RENDERING[os.getpid()].submit(int).result()
    names = (task.read_text() for task in Path("/proc/self/task").glob("*/comm"))
    if any(name.startswith("llvmpipe") for name in names):
        WITH_THREADS.add(os.getpid())


os.register_at_fork(before=_before_fork)


def _asked() -> str:
    return os.environ.get(CHOSEN_BY, "").strip().lower()


def _library(name: str) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(name)
    except OSError:
        return None


def _load_triton() -> None:
    """Load the library of Triton, which comes with PyTorch, before Mesa's: both contain LLVM, and
    in the other order the process crashes (Triton of PyTorch 2.15, Mesa 22.3; 0.1 s).
    """
    found = importlib.util.find_spec("triton")
    for folder in (found.submodule_search_locations if found else None) or ():
        _library(f"{folder}/_C/libtriton.so")


def _require(name: str, remedy: str) -> None:
    if _library(name) is None:
        raise NoRenderer(f"The OpenGL library {name} is missing on this machine: run {remedy}.")


def _has_device() -> bool:
    """Try to initialise an EGL device (needs a DRI driver, which libEGL alone does not
    bring).
    """
    try:
        egl: Any = importlib.import_module("mujoco.egl")
        return bool(egl.create_initialized_egl_device_display())
    except Exception:  # of PyOpenGL, where the library has no such functions
        return False

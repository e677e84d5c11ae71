"""The OpenGL context of a process: on Linux all renderers share one, in a thread of its own;
elsewhere each thread that renders has its own. Also checks whether this machine has OpenGL.

MuJoCo's wheel ships no OpenGL. Without it MuJoCo fails with messages that name the wrong cause, so
this file checks first.
"""

import ctypes
import functools
import importlib
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TypeVar

from sim.stderr import silent_libraries

INSTALL = (
    "'apt-get install --no-install-recommends libegl1 libgl1 libgl1-mesa-dri' (Debian, Ubuntu), "
    "'dnf install mesa-libEGL mesa-libGL mesa-dri-drivers' (Fedora) or 'pacman -S mesa' (Arch)"
)
"""Commands that install OpenGL on a machine without a GPU."""
LIBRARIES = {
    "egl": (("libEGL.so.1", "libGL.so.1"), INSTALL),
    "osmesa": (
        ("libOSMesa.so.8",),
        "'apt-get install --no-install-recommends libosmesa6 libgl1'",
    ),
}
"""Libraries that each back end needs on Linux, and the command that installs them."""
NO_CONTEXT = (
    'OpenGL made no context. On Linux set camera.renderer = "exact", which needs no OpenGL; macOS '
    "gives OpenGL only to a user who is logged in at the screen, not over ssh or to a service"
)
CHOSEN_BY = "MUJOCO_GL"
OFF = ("off", "disable", "disabled", "false", "0")
"""Values of MUJOCO_GL that switch rendering off."""
KNOWN = (*OFF, "", "on", "enable", "enabled", "true", "1", "glfw", "glx", "cgl", *LIBRARIES)
"""Values of MUJOCO_GL that MuJoCo accepts on Linux or macOS."""
NO_WINDOW = 16
"""Side of a context's own buffer [px]: everything is rendered into buffers of MuJoCo's."""
KEPT = threading.local()
"""The GL context of a thread. To make one takes 0.2 s of CPU, so it is kept until the end of the
process; a context belongs to the thread that made it.
"""
RENDERING: dict[int, ThreadPoolExecutor] = {}
"""The thread that renders, by process: a forked one does not have its parent's."""
RETURNED: dict[int, SimpleQueue[Callable[[], object]]] = {}
"""Functions that `call_later` has queued and that have not run yet, by process."""
Result = TypeVar("Result")

WITHOUT = "SERVOBENCH_WITHOUT_OPENGL"
"""Variable that is set once the user was told that there is no OpenGL: child processes do not
repeat it."""
RASTERISERS = ("llvmpipe", "softpipe", "swrast")
"""Beginnings of the names of Mesa's rasterisers, which draw on the processor."""
MESA_THREADS = "LP_NUM_THREADS"
"""Environment variable with the number of threads of Mesa's rasteriser. These threads do not
survive a fork, and a child process would wait for them for ever, so by default there are none;
pictures of 320 x 240 px are rendered as fast without them."""


class NoRenderer(RuntimeError):
    """Error: this process cannot render by OpenGL, which the exact renderer does not need; the
    message gives the reason and the remedy.
    """


def backend() -> str:
    """Return MuJoCo's name of the OpenGL back end for this machine: 'egl' or 'osmesa' on Linux,
    'glfw' elsewhere. As a side effect, set the environment variable LP_NUM_THREADS (threads of
    Mesa's software rasteriser) to 0 if it is not set.

    Raises:
        NoRenderer: A library or a driver is missing, or MUJOCO_GL switches rendering off.
    """
    os.environ.setdefault(MESA_THREADS, "0")  # Mesa reads it when libEGL is first asked
    asked = _asked()
    if asked in OFF:
        raise NoRenderer(
            f"Rendering is switched off by the environment variable {CHOSEN_BY}={asked}: unset it."
        )
    if sys.platform != "linux":
        return "glfw"
    name = "osmesa" if asked == "osmesa" else "egl"
    _require(name)
    with silent_libraries():
        answers = name == "osmesa" or _has_device()
    if not answers:
        raise NoRenderer(
            f"No OpenGL driver answers on this machine (libEGL finds no device): run {INSTALL}."
        )
    return name


@functools.cache
def is_there() -> bool:
    """Return whether OpenGL can render: this machine has it, and MUJOCO_GL does not switch it off.
    If not, say on stderr that the renderer "exact" is used; the line appears once for this process
    and the processes that it starts.
    """
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
    """Check the environment variable MUJOCO_GL, and remove the variable PYOPENGL_PLATFORM; to be
    called before MuJoCo is imported.

    Raises:
        NoRenderer: MUJOCO_GL names an OpenGL back end that does not exist, or whose libraries are
            missing on this machine.
    """
    asked = _asked()
    if asked not in KNOWN:
        raise NoRenderer(
            f"the environment variable {CHOSEN_BY}={asked} names no OpenGL back end: unset it, or "
            "set it to egl."
        )
    if asked in LIBRARIES:
        _require(asked)
    os.environ.pop("PYOPENGL_PLATFORM", None)  # MuJoCo sets it to its back end


def call(function: Callable[..., Result], *args: object) -> Future[Result]:
    """Run a function where this process's OpenGL context is current, and return the future of its
    result.

    On Linux one thread of the process runs all these functions, in the order of the calls: pictures
    are drawn while the caller works on earlier ones, and any thread may ask for them. Elsewhere the
    function runs in the calling thread, before this returns.

    Raises:
        NoRenderer: A library is missing, rendering is switched off, or OpenGL makes no context. On
            Linux `result()` of the future raises this error, and any error of the function;
            elsewhere this call raises both.
    """
    if sys.platform != "linux":  # GLFW makes contexts in the main thread only
        done: Future[Result] = Future()
        done.set_result(_with_context(function, *args))
        return done
    return rendering().submit(_with_context, function, *args)


def call_later(function: Callable[..., object], *args: object) -> None:
    """Queue a function that is to run just before the function of the next `call`, where an OpenGL
    context of this process is current; return at once.

    It takes no lock: the garbage collector may close an abandoned run in any thread, even while
    that thread asks for a picture.
    """
    returned = RETURNED.setdefault(os.getpid(), SimpleQueue())
    returned.put(functools.partial(function, *args))


def rendering() -> ThreadPoolExecutor:
    """Return the executor whose single thread renders for this process; `os.fork` waits until this
    thread is idle.
    """
    if os.getpid() not in RENDERING:
        pool = ThreadPoolExecutor(1, "rendering")
        # Ctrl-C is raised in the main thread only. Raised while the pool starts its thread, it
        # would leave a thread that the pool does not know: the process would wait for it for ever.
        starting = threading.Thread(target=pool.submit, args=(int,))
        starting.start()
        starting.join()
        RENDERING.setdefault(os.getpid(), pool)
    return RENDERING[os.getpid()]


def _with_context(function: Callable[..., Result], *args: object) -> Result:
    """Call the functions that `call_later` has queued, then a function, and return its result.

    The first call in a thread makes the thread's OpenGL context, without MuJoCo's own choice of a
    back end, which depends on the value of MUJOCO_GL when MuJoCo was imported.

    Raises:
        NoRenderer: A library is missing, rendering is switched off, or OpenGL makes no context.
    """
    if not hasattr(KEPT, "context"):
        _make_context(backend())
    returned = RETURNED.setdefault(os.getpid(), SimpleQueue())
    with suppress(Empty):
        while True:
            returned.get_nowait()()
    return function(*args)


def _make_context(name: str) -> None:
    try:
        context = importlib.import_module(f"mujoco.{name}").GLContext(NO_WINDOW, NO_WINDOW)
        if name == "glfw" and not context._context:
            raise RuntimeError("GLFW made no window")  # MuJoCo goes on without one
    except Exception as error:
        raise NoRenderer(f"{NO_CONTEXT} ({error}).") from error
    context.make_current()
    KEPT.context = context


def describe() -> str:
    """Return the OpenGL renderer's name and the OpenGL version as one text, "NAME, VERSION", as the
    driver reports them.

    Raises:
        NoRenderer: This machine has no OpenGL, or rendering is switched off.
    """
    return call(_names).result()


def has_gpu() -> bool:
    """Return True if OpenGL renders on a GPU; False if one of Mesa's software rasterisers renders,
    or if there is no OpenGL.
    """
    try:
        backend()
        return not describe().startswith(RASTERISERS)
    except NoRenderer:
        return False


def _names() -> str:
    opengl = importlib.import_module("OpenGL.GL")
    names = (opengl.GL_RENDERER, opengl.GL_VERSION)
    return ", ".join(opengl.glGetString(name).decode() for name in names)


def finish() -> None:
    """On Linux, wait until OpenGL has drawn everything, while other Python threads can run;
    MuJoCo's reading of pixels would wait for this too, but stop these threads. On other systems, do
    nothing.
    """
    if sys.platform == "linux":
        _opengl().glFinish()


@functools.cache  # opening it takes 0.1 ms
def _opengl() -> ctypes.CDLL:
    return ctypes.CDLL("libGL.so.1")


def _before_fork() -> None:
    """Wait until the rendering thread is idle: a fork would copy locks that it holds."""
    if os.getpid() in RENDERING:
        with suppress(RuntimeError):  # the interpreter is shutting down
            RENDERING[os.getpid()].submit(int).result()


os.register_at_fork(before=_before_fork)


def _asked() -> str:
    return os.environ.get(CHOSEN_BY, "").strip().lower()


def _require(name: str) -> None:
    """Load the libraries of a back end.

    Raises:
        NoRenderer: One is missing.
    """
    libraries, remedy = LIBRARIES[name]
    for library in libraries:
        try:
            ctypes.CDLL(library)
        except OSError:
            raise NoRenderer(
                f"The OpenGL library {library} is missing on this machine: run {remedy}."
            ) from None


def _has_device() -> bool:
    """Return whether an EGL device can be initialised: it needs a DRI driver, which libEGL alone
    does not bring.
    """
    try:
        egl = importlib.import_module("mujoco.egl")
        return bool(egl.create_initialized_egl_device_display())
    except Exception:  # of PyOpenGL, where the library has no such functions
        return False

"""Machines that have some of OpenGL's libraries, or none."""

import ctypes
import sys
from types import SimpleNamespace

from sim.camera import gl

OPENGL = "libEGL", "libGL", "libOpenGL", "libOSMesa"


def machine_with(monkeypatch, *names, device=True):
    """Make this a Linux machine that has these libraries of OpenGL, and perhaps a device; the list
    that is returned has what is loaded.
    """
    real, loaded = ctypes.CDLL, []

    def load(name, *rest, **more):
        of_opengl = str(name).startswith(OPENGL) or name in names
        if of_opengl and name not in names:
            raise OSError(name)
        loaded.append(name)
        return SimpleNamespace() if of_opengl else real(name, *rest, **more)

    def probe():
        loaded.append("driver")
        return device

    egl = SimpleNamespace(create_initialized_egl_device_display=probe)
    monkeypatch.setitem(sys.modules, "mujoco.egl", egl)
    monkeypatch.setattr(gl.sys, "platform", "linux")
    monkeypatch.setattr(gl.ctypes, "CDLL", load)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    return loaded

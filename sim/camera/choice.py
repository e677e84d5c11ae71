"""The renderer of a camera: OpenGL where it is asked for and there, else the exact one."""

from sim.camera import gl
from sim.camera.camera import Kind
from sim.camera.renderer import MakeRenderer, OpenGLRenderer


def renderer_of(kind: Kind) -> MakeRenderer:
    """Return what makes the renderer that a camera's settings name, or `exact` without OpenGL."""
    if kind == "opengl" and gl.is_there():
        return OpenGLRenderer
    from sim.camera.exact.renderer import ExactRenderer  # loads compiled code

    return ExactRenderer

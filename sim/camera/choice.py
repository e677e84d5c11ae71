"""Choice of the renderer: OpenGL if the settings name it and the machine has it, else `exact`."""

from sim.camera import gl
from sim.camera.camera import Kind
from sim.camera.renderer import MakeRenderer, OpenGLRenderer


def renderer_of(kind: Kind) -> MakeRenderer:
    """Return the maker of the renderer that the settings name; without OpenGL, of `exact`."""
    if kind == "opengl" and gl.is_there():
        return OpenGLRenderer
    from sim.camera.exact.renderer import ExactRenderer  # loads compiled code

    return ExactRenderer

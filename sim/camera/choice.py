"""Choice of the renderer: OpenGL if the settings ask for it and the machine has it, else the
software renderer `exact`.
"""

from sim.camera import gl
from sim.camera.camera import Kind
from sim.camera.renderer import MakeRenderer, OpenGLRenderer


def renderer_of(kind: Kind) -> MakeRenderer:
    """Return the class of the renderer that the setting `camera.renderer` names; on a machine
    without OpenGL, that of the software renderer "exact".

    Raises:
        ValueError: `kind` is "recording": only a scenario with a table [recording] has such a
            renderer.
    """
    if kind == "recording":
        raise ValueError('camera.renderer = "recording" needs a table [recording]')
    if kind == "opengl" and gl.is_there():
        return OpenGLRenderer
    from sim.camera.exact.renderer import ExactRenderer  # loads compiled code

    return ExactRenderer

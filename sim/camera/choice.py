"""Choice of the renderer: OpenGL if the settings ask for it and the machine has it, else the
software renderer `exact`.
"""

from functools import partial

from sim.camera import gl
from sim.camera.camera import CameraConfig
from sim.camera.renderer import MakeRenderer, OpenGLRenderer


def renderer_of(config: CameraConfig) -> MakeRenderer:
    """Return the function that makes the renderer which a camera's settings ask for: the OpenGL
    renderer, or the software renderer "exact". On a machine without OpenGL it is always "exact"; if
    OpenGL was asked for, a line on stderr says so, once.

    Raises:
        ValueError: `config.renderer` is "recording": only a scenario with a table [recording] has
            such a renderer.
    """
    if config.renderer == "recording":
        raise ValueError(
            'camera.renderer = "recording" needs a table [recording]: add it, or choose another '
            "renderer"
        )
    if config.renderer == "opengl" and gl.is_there():
        return OpenGLRenderer
    from sim.camera.exact.renderer import ExactRenderer  # loads compiled code

    return partial(ExactRenderer, fine=config.textures == "fine", shaded=config.shadows)

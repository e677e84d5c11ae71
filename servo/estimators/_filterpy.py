"""filterpy's Kalman filter, imported without the rest of filterpy: that would import scipy.stats
and scipy.ndimage, 0.6 s of CPU in each process, for densities and filters that are not used here.
"""

import functools
import importlib
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGES = ("filterpy", "filterpy.kalman")


@functools.cache  # each run asks, and this import is forgotten again
def kalman_filter() -> Any:
    """Return the class `filterpy.kalman.KalmanFilter`."""
    if PACKAGES[-1] in sys.modules:
        return sys.modules[PACKAGES[-1]].KalmanFilter
    spec = find_spec(PACKAGES[0])
    assert spec is not None
    assert spec.origin is not None
    for name in PACKAGES:  # empty ones, in which Python finds the class's own module
        package = ModuleType(name)
        package.__path__ = [str(Path(spec.origin).parent.joinpath(*name.split(".")[1:]))]
        sys.modules[name] = package
    densities: Any = ModuleType("filterpy.stats")
    densities.logpdf = None
    sys.modules[densities.__name__] = densities
    try:
        return importlib.import_module("filterpy.kalman.kalman_filter").KalmanFilter
    finally:  # whoever imports filterpy later gets all of it
        for name in [n for n in sys.modules if n.partition(".")[0] == PACKAGES[0]]:
            del sys.modules[name]

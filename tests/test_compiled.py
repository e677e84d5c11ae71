"""Where compiled loops are kept: beside their source, and in the temporary folder at worst."""

import importlib.util
import os
import stat
import subprocess
import sys

import pytest

from sim import compiled
from sim.compiled import SLOW

pytestmark = pytest.mark.processes

READ_ONLY = """
import numba, numba.core.caching as caching
for name in ("InTreeCacheLocator", "UserWideCacheLocator"):
    getattr(caching, name).from_function = classmethod(lambda *_: None)
import numpy as np
from tracking.loops.particle_loops import normalised
from sim.camera.exact.raster import dot
print(normalised(np.zeros(4)).tolist(), dot(np.ones(3), np.ones(3)), [numba.config.CACHE_DIR])
"""
ANSWER = "[0.25, 0.25, 0.25, 0.25] 3.0 ['{}']\n"
"""Of a tracker's loop, of one that draws, and the folder for loops of other packages."""
RASTER_FIRST = "import sim.camera.exact.raster"


def run(program, **environment):
    """The end of a Python process in an environment with these variables only."""
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment)


@pytest.mark.parametrize("first", ["", RASTER_FIRST])
def test_an_installation_that_cannot_be_written_keeps_loops_in_the_temporary_folder(
    tmp_path, first
):
    """Those of trackers and those that draw, whichever are imported first."""
    places = {"TMPDIR": str(tmp_path), "HOME": "/nonexistent"}
    program = READ_ONLY.replace("import numpy as np", f"{first}\nimport numpy as np")
    ended = run(program, **places)
    (folder,) = tmp_path.iterdir()
    assert ended.stdout == ANSWER.format("")
    assert ended.stderr == SLOW.format(f"only in {folder}, which may not last") + "\n"
    kept = {path.name.split(".")[0] for path in folder.rglob("*.nbi")}
    assert kept == {"particle_loops", "raster"}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert run(program, **places).stderr == ""


def test_where_no_folder_can_be_written_a_line_says_what_that_costs(tmp_path):
    """The loops run all the same."""
    nowhere = f"import tempfile; tempfile.tempdir = '{tmp_path / 'none'}'"
    ended = run(nowhere + READ_ONLY, HOME="/nonexistent")
    assert ended.stdout == ANSWER.format("")
    reason = f"[Errno 2] No such file or directory: '{tmp_path / 'none'}/"
    assert ended.stderr.startswith(SLOW.split("(")[0] + "(" + reason)
    assert ended.stderr.endswith("; set NUMBA_CACHE_DIR to a folder that can be written\n")
    assert ended.stderr.count("\n") == 1


def test_a_full_disk_costs_a_line_and_not_the_run(tmp_path):
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))\n"
    # Python 3.11 keeps bytecode that did not fit, and cannot import it afterwards.
    ended = run(full + READ_ONLY, NUMBA_CACHE_DIR=str(tmp_path), PYTHONDONTWRITEBYTECODE="1")
    assert ended.stdout == ANSWER.format(tmp_path)
    assert ended.stderr.startswith(f"{SLOW.split('{')[0]}{tmp_path}")
    assert "File too large): compiling them takes 30 s in each run; set NUMBA" in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("trap", ["link", "open to all", "file"])
def test_a_folder_that_somebody_else_may_write_to_is_not_used(monkeypatch, tmp_path, trap):
    """Compiled code is executed: it comes from nobody else."""
    monkeypatch.setattr(compiled.tempfile, "tempdir", str(tmp_path))
    usual = tmp_path / compiled.NAME.format(os.getuid())
    if trap == "link":
        (tmp_path / "elsewhere").mkdir()
        usual.symlink_to(tmp_path / "elsewhere")
    elif trap == "file":
        usual.write_text("")
    else:
        usual.mkdir()
        usual.chmod(0o777)
    spec = importlib.util.spec_from_file_location("compiled_again", compiled.__file__)
    again = importlib.util.module_from_spec(spec)  # it has not chosen its folder
    spec.loader.exec_module(again)
    other = again._private_folder()
    assert other != usual
    assert stat.S_IMODE(other.stat().st_mode) == 0o700

"""Where the compiled loops are kept: beside their source, and in the temporary folder at worst."""

import stat
import subprocess
import sys

import pytest

from tracking.loops import compiled

READ_ONLY = """
import numba, numba.core.caching as caching
for name in ("InTreeCacheLocator", "UserWideCacheLocator"):
    getattr(caching, name).from_function = classmethod(lambda *_: None)
import numpy as np
from tracking.loops.particle_loops import normalised
print(normalised(np.zeros(4)).tolist(), numba.config.CACHE_DIR)
"""


def test_an_installation_that_cannot_be_written_keeps_loops_in_the_temporary_folder(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-c", READ_ONLY],
        capture_output=True,
        text=True,
        check=True,
        env={"TMPDIR": str(tmp_path), "HOME": "/nonexistent"},
    )
    (folder,) = tmp_path.iterdir()
    assert ended.stdout == f"[0.25, 0.25, 0.25, 0.25] {folder}\n"
    assert list(folder.rglob("*.nbi"))
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("trap", ["link", "open to all", "file"])
def test_a_folder_that_somebody_else_may_write_to_is_not_used(monkeypatch, tmp_path, trap):
    """Compiled code is executed: it comes from nobody else."""
    monkeypatch.setattr(compiled.tempfile, "tempdir", str(tmp_path))
    usual = compiled._private_folder()
    usual.rmdir()
    if trap == "link":
        (tmp_path / "elsewhere").mkdir()
        usual.symlink_to(tmp_path / "elsewhere")
    elif trap == "file":
        usual.write_text("")
    else:
        usual.mkdir()
        usual.chmod(0o777)
    other = compiled._private_folder()
    assert other != usual
    assert stat.S_IMODE(other.stat().st_mode) == 0o700

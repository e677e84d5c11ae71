"""What the package offers to import, the command as a module, and files that hide our packages."""

import ast
import os
import subprocess
import sys
from importlib import import_module, metadata

import pytest
from commands import BIN

import servo

HEAVY = ("numpy", "mujoco", "cv2", "numba", "pydantic", "rerun", "click", "importlib.metadata")
HIDDEN = {
    "sim.py": "file",
    "tracking.py": "file",
    "scenes.py": "file",
    "sim": "folder",
    "tracking/__init__.py": "folder",
}


def ended(*words, place=None, **environment):
    """Exit code, stdout and stderr of a process."""
    told = subprocess.run(
        [*words],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )
    return told.returncode, told.stdout, told.stderr


@pytest.mark.parametrize("name", [n for names in servo.HOMES.values() for n in names])
def test_a_public_name_is_what_its_module_has(name):
    (home,) = [home for home, names in servo.HOMES.items() if name in names]
    assert getattr(servo, name) is getattr(import_module(home), name)


def test_names_types_and_homes_agree(root):
    tree = ast.parse((root / "servo" / "__init__.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        n.module: tuple(a.name for a in n.names)
        for n in block.body
        if isinstance(n, ast.ImportFrom)
    }
    assert typed == servo.HOMES
    assert sorted([*sum(servo.HOMES.values(), ()), "__version__"]) == sorted(servo.__all__)
    assert dir(servo) == sorted(servo.__all__)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"^module 'servo' has no attribute 'lode'$"):
        servo.lode  # noqa: B018


def test_the_import_loads_nothing_heavy(tmp_path):
    code = f"import sys, servo; print([name for name in {HEAVY} if name in sys.modules])"
    assert ended(sys.executable, "-c", code, place=tmp_path) == (0, "[]\n", "")


def test_the_version_is_the_packages():
    version = metadata.version("servobench")
    assert servo.__version__ == version
    assert ended(BIN / "servobench", "--version") == (0, f"servobench {version}\n", "")


def test_the_module_is_the_command(tmp_path):
    of_command = ended(BIN / "servobench", "list", "motion", place=tmp_path)
    assert of_command[0] == 0
    assert ended(sys.executable, "-m", "servo", "list", "motion", place=tmp_path) == of_command


@pytest.fixture(params=HIDDEN)
def hiding(request, tmp_path):
    """A folder in which a file or a folder has the name of one of our packages, and the sentence
    about it.
    """
    path = tmp_path / request.param
    (path.parent if path.suffix else path).mkdir(exist_ok=True)
    if path.suffix:
        path.write_text("raise RuntimeError('this is not to be imported')\n")
    found = path.parent if path.name == "__init__.py" else path
    return tmp_path, (
        f"{found} hides servobench's package '{found.stem}': rename this {HIDDEN[request.param]}"
    )


def test_a_file_that_hides_a_package_is_named(hiding):
    place, sentence = hiding
    code, out, err = ended(sys.executable, "-c", "import servo", place=place)
    assert (code, out, err.splitlines()[-1]) == (1, "", f"ImportError: {sentence}")


@pytest.mark.parametrize("command", [(sys.executable, "-m", "servo"), (BIN / "servobench",)])
def test_a_file_that_hides_a_package_ends_the_command(hiding, command):
    place, sentence = hiding
    given = ended(*command, "list", place=place, PYTHONPATH=str(place))
    assert given == (2, "", f"servobench: {sentence}\n")


def test_the_console_command_does_not_see_the_current_folder(tmp_path):
    (tmp_path / "sim.py").write_text("")
    code, _, err = ended(BIN / "servobench", "list", "motion", place=tmp_path)
    assert (code, err) == (0, "")


def test_a_script_beside_a_file_that_hides_a_package_can_say_so_itself(tmp_path):
    (tmp_path / "tracking.py").write_text("")
    script = tmp_path / "mine.py"
    script.write_text(
        "try:\n    import servo\nexcept ImportError as e:\n    print(e.name, e.path)\n"
    )
    given = ended(sys.executable, str(script))
    assert given == (0, f"tracking {tmp_path / 'tracking.py'}\n", "")

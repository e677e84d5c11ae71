"""Commands that start in a tenth of a second: a process that has imported what they need forks.

Such a command has the words, folder, environment, streams and limit that its test gives, and a
session of its own. What a program does at its start, or where it is installed, needs a usual start.
"""

import gc
import json
import os
import resource
import runpy
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

PLACE = "SERVOBENCH_PRELOADED"
"""Environment variable: the socket of the process, which all workers of pytest share."""
PROGRAMS = {"servobench": "servo.__main__", "dask": "dask.__main__"}
SCRIPT = "python"
"""The program whose first word is a Python file."""
ON_PATH = """#!{python} -P
import sys

sys.path.append({folder!r})
from preloaded import Command

sys.exit(Command(sys.argv[1:], stdout="/dev/stdout", stderr="/dev/stderr").wait())
"""
IMPORTED = (
    "dask.__main__",
    "distributed.cli.dask_scheduler",
    "distributed.cli.dask_worker",
    "matplotlib.pyplot",
    "pyarrow.dataset",
    "scipy.stats",
    "servo.cli.check_command",
    "servo.cli.evaluate_command",
    "servo.cli.film_command",
    "servo.cli.main",
    "servo.cli.report_command",
    "servo.cli.run_command",
    "servo.cli.sweep_command",
    "servo.cli.track_command",
    "servo.controllers.ibvs",
    "servo.estimators.kalman_cv",
    "servo.output.light_page",
    "servo.output.recording.live",
    "servo.output.recording.view",
    "servo.study.cluster.local",
    "servo.study.cluster.remote",
    "tracking.drawing.video_writer",
    "tracking.trackers.frozen",
    "pandas",  # PyArrow imports it, where it is, with the first table
)
PATIENCE = 180.0
"""No step of a test takes longer [s]."""
OUTPUTS = (1, 2)
"""Standard output and error."""


@contextmanager
def preloaded():
    """Start the process; it ends with the block, or with the process that called this."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ[PLACE] = str(Path(folder) / "socket")
        command = [sys.executable, "-P", __file__, os.environ[PLACE]]
        with subprocess.Popen(command, stdin=subprocess.PIPE):
            yield
        del os.environ[PLACE]


class Command:
    """A forked command, by those names of `subprocess.Popen` that tests use; its text is UTF-8."""

    def __init__(
        self,
        words,
        *,
        cwd=None,
        env=None,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        largest=None,
        program="servobench",
    ):
        """Begin it.

        Args:
            stdout, stderr: PIPE, the path of a file or device, or None for a closed stream.
            largest: Size of the largest file that it may write [bytes].
        """
        asked = {
            "program": program,
            "words": [str(word) for word in words],
            "cwd": str(cwd or Path.cwd()),
            "env": dict(os.environ if env is None else env),
            "largest": largest,
        }
        (self.stdout, out), (self.stderr, err) = map(_ends, (stdout, stderr))
        its = {1: out, 2: err}
        its = {number: file for number, file in its.items() if file is not None}
        self.returncode = None
        self._server = _connected()
        socket.send_fds(self._server, [b"."], list(its.values()))
        self._answers = self._server.makefile("rw")
        self._answers.write(json.dumps(asked | {"streams": list(its)}) + "\n")
        self._answers.flush()
        for file in its.values():
            os.close(file)
        self.pid = int(self._answers.readline())

    def poll(self):
        """Its exit code as of Popen; None while it runs."""
        return self._code(0.0)

    def wait(self, timeout=PATIENCE):
        if self._code(timeout) is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout)
        return self.returncode

    def communicate(self, timeout=PATIENCE):
        """What it prints until all who hold its streams have ended, and its end."""
        texts = {}

        def read(file):
            with file:
                texts[file] = file.read()

        files = [file for file in (self.stdout, self.stderr) if file is not None]
        readers = [threading.Thread(target=read, args=(file,), daemon=True) for file in files]
        until = time.monotonic() + timeout
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join(until - time.monotonic())
            if reader.is_alive():
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
        self.wait(max(0.0, until - time.monotonic()))
        return texts.get(self.stdout), texts.get(self.stderr)

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def terminate(self):
        self.send_signal(signal.SIGTERM)

    def _code(self, timeout):
        if self.returncode is None and select.select([self._server], [], [], timeout)[0]:
            self.returncode = int(self._answers.readline())
            self._answers.close()
            self._server.close()
        return self.returncode


def ran(words, **more):
    """Exit code, stdout and stderr of a command that has ended; None for what is no pipe."""
    command = Command(words, **more)
    out, err = command.communicate(4 * PATIENCE)
    return command.returncode, out, err


def on_path(folder):
    """Write a program `servobench` that hands its words to the process; return its folder."""
    folder.mkdir()
    file = folder / "servobench"
    file.write_text(ON_PATH.format(python=sys.executable, folder=str(Path(__file__).parent)))
    file.chmod(0o755)
    return folder


def _ends(given):
    """Our end of a stream as a file, and the command's end as a number."""
    if given is None:
        return None, None
    if given == subprocess.PIPE:
        ours, theirs = os.pipe()
        return os.fdopen(ours, encoding="utf-8"), theirs
    return None, os.open(given, os.O_WRONLY | os.O_CREAT)


def _connected():
    """A connection to the process, which has imported all."""
    until = time.monotonic() + PATIENCE
    while True:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(os.environ[PLACE])
        except (FileNotFoundError, ConnectionRefusedError):
            connection.close()
            if time.monotonic() > until:
                raise
            time.sleep(0.02)
        else:
            return connection


def serve(place):
    """Import all, and fork for each command that is asked for; returns in these: its program."""
    # As a command sets them before it imports the libraries that read them.
    os.environ.update(import_module("servo.cli.guard").ENVIRONMENT | {"MPLBACKEND": "agg"})
    for name in IMPORTED:
        import_module(name)
    _ready_compiled_loops()
    gc.freeze()
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(place)
        listening.listen(64)
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for those that watch
        while sys.stdin not in select.select([listening, sys.stdin], [], [])[0]:
            connection, _ = listening.accept()
            if os.fork() == 0:
                return _watched(connection)
            connection.close()
    sys.exit()


def _ready_compiled_loops():
    """Import the hundred modules that Numba imports before it runs its first function."""
    target = import_module("numba.core.registry").cpu_target
    target.typing_context.refresh()
    target.target_context.refresh()


def _watched(connection):
    """Fork the command, and say how it ended; returns in the command: its program."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    _, files, _, _ = socket.recv_fds(connection, 1, len(OUTPUTS))
    asked = json.loads(connection.makefile().readline())
    pid = os.fork()
    if pid == 0:
        os.setsid()
        connection.sendall(b"%d\n" % os.getpid())
        connection.close()
        _become(asked, files)
        return asked["program"]
    for file in files:
        os.close(file)
    _, status = os.waitpid(pid, 0)
    connection.sendall(b"%d\n" % os.waitstatus_to_exitcode(status))
    os._exit(0)


def _become(asked, files):
    """What a shell gives to a program, and Python to its first module."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(asked["env"])
    os.chdir(asked["cwd"])
    files.append(os.open(os.devnull, os.O_RDONLY))
    os.dup2(files[-1], 0)
    for number, stream in zip(OUTPUTS, ("stdout", "stderr"), strict=True):
        if number in asked["streams"]:
            os.dup2(files[asked["streams"].index(number)], number)
            setattr(sys, stream, os.fdopen(number, "w", encoding="utf-8", closefd=False))
        else:
            os.close(number)
            setattr(sys, stream, None)
    for file in files:
        os.close(file)
    if asked["largest"] is not None:
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (asked["largest"], hard))
    if any(name.startswith("DASK_") for name in os.environ):
        import_module("dask.config").refresh()  # it was read at the import
    sys.dont_write_bytecode = bool(os.environ.get("PYTHONDONTWRITEBYTECODE"))
    if asked["program"] == SCRIPT:
        sys.path.insert(0, str(Path(asked["words"][0]).parent.absolute()))
        sys.argv = asked["words"]
    else:
        sys.argv = [asked["program"], *asked["words"]]


def main(place):
    """Be the process, and then each of its commands."""
    program = serve(place)
    if program == SCRIPT:
        runpy.run_path(sys.argv[0], run_name="__main__")
    else:
        sys.exit(import_module(PROGRAMS[program]).main())


if __name__ == "__main__":
    main(sys.argv[1])

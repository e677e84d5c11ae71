"""Commands as processes of their own: begun, killed, stopped and continued, and what they leave."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
from preloaded import PATIENCE, Command

BIN = Path(sys.executable).parent
STOPPED = "servobench: stopped; what was written is complete up to here."
QUICK = "--set tracker.kind=frozen --set estimator.kind=none"


def begin(words, cwd=None):
    """Begin a command in a session of its own, of which only stderr is read."""
    return Command(words.split(), cwd=cwd, stdout=os.devnull)


def begin_afresh(words, cwd=None, env=None):
    """The same as a user starts it: it imports first."""
    return subprocess.Popen(
        [BIN / "servobench", *words.split()],
        cwd=cwd,
        env=env,
        start_new_session=True,
        preexec_fn=hear,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


ONE_BY_ONE = """
import contextlib, io, json, sys
from servo.cli.main import main
ended = []
for words in json.loads(sys.argv[1]):
    out, err, sys.argv = io.StringIO(), io.StringIO(), ["servobench", *words]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main()
        except SystemExit as end:
            code = end.code
    ended.append((code or 0, out.getvalue(), err.getvalue()))
    import servo, scenes
print(json.dumps([[servo.__file__, scenes.__file__], *ended]))
"""


def one_by_one(lines, cwd, folder):
    """Do commands with the packages of a folder, all in one process, which takes a second to start.

    Returns the files of `servo` and `scenes`, then exit code, stdout and stderr of each command.
    """
    words = json.dumps([line.split() for line in lines])
    ended = subprocess.run(
        [sys.executable, "-c", ONE_BY_ONE, words],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "200"},
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return json.loads(ended.stdout)


def hear():
    """A shell's background, where these tests perhaps run, ignores signals; so would we."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@contextmanager
def scheduler_with(workers=1, protocol="tcp"):
    """A Dask scheduler and workers of it on this machine: their processes, and its address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address, host = f"{protocol}://127.0.0.1:{port}", f"{protocol}://127.0.0.1"
    quiet = {"program": "dask", "stdout": os.devnull, "stderr": os.devnull}
    where = ["--host", host, "--no-dashboard"]
    worker = ["worker", address, "--nthreads", "1", "--no-nanny", *where]
    started = [Command(["scheduler", "--port", str(port), *where], **quiet)]
    try:
        wait_for(lambda: answers(port))
        started += [Command(worker, **quiet) for _ in range(workers)]
        yield started, address
    finally:
        for process in started:
            process.kill()
        for process in started:
            process.wait(PATIENCE)


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def ended(command):
    """Exit code and stderr, once the command and all its children have ended."""
    try:
        _, said = command.communicate(timeout=PATIENCE)  # children hold stderr open
        wait_for(lambda: not alive(command.pid))
    finally:
        for pid in alive(command.pid):
            os.kill(pid, signal.SIGKILL)
    return command.returncode, said


def wait_for(condition):
    until = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < until:
        time.sleep(0.03)  # to look at all processes takes 4 ms, which they would use
    assert condition()


def workers_of(command):
    """Process numbers of its local workers, those included that still start."""
    spawned = [pid for pid, (_, words) in alive(command.pid).items() if "spawn_main" in words]
    return [pid for pid in spawned if pid != command.pid]


def alive(session):
    """The processes of a session: their parents, and by what they were started."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent, _, its = stat.read_text().rsplit(")", 1)[1].split()[:4]
            if int(its) == session and state != "Z":
                words = (stat.parent / "cmdline").read_text().replace("\0", " ")
                found[int(stat.parent.name)] = int(parent), words
        except OSError:
            continue  # it has ended meanwhile
    return found


def listening(pids):
    """The addresses at which processes listen, as /proc/net/tcp has them."""
    sockets = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").glob("*"):
            try:
                sockets.add(str(link.readlink()))
            except OSError:
                continue
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                found.add(fields[1].split(":")[0])
    return found


def frames_in(stream):
    """The frames whose rows a run's stream has by now."""
    frames = []
    try:
        with stream.open("rb") as file:
            reader = pa.ipc.open_stream(file)
            while True:
                frames += reader.read_next_batch()["frame"].to_pylist()
    except (StopIteration, pa.ArrowInvalid, OSError):
        return frames

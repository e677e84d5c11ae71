"""Clusters that the user has already, and the limits of one's own: all end in one sentence."""

import resource
import shutil
import socket
import subprocess
import sys
import threading
from pathlib import Path

import dask.config
import pytest
from kept import found
from preloaded import ran

from servo.cli import main
from servo.mistake import Mistake, Refused
from servo.study.cluster import local as processes
from servo.study.cluster import tasks as watched
from servo.study.cluster.remote import check_address, remote
from servo.study.cluster.tasks import carry_out
from servo.study.run import ClusterLost

pytestmark = pytest.mark.processes

ADVICE = (
    "start a scheduler and a worker there, or correct the address or, for tls://, the certificates"
)

STUDY = """# mine
# Short runs, of kinds that are quick to import.
scenario = "still"
seeds = 2

[set]
run.duration = 0.3
tracker.kind = "frozen"
estimator.kind = "none"
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(STUDY)
    return tmp_path


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code, capfd.readouterr().err


def sweep(monkeypatch, capfd, address):
    return call(
        monkeypatch, capfd, "sweep", "mine.toml", "--out", "o", "--scheduler", address, "-q"
    )


@pytest.mark.parametrize(
    "address",
    [
        "",
        "garbage",
        "tcp://",
        "tcp://h:0",
        "tcp://h:99999",
        "tcp://h:x",
        "tcp://[::1:80",
        "h",
        "ws://h:1",
        "wss://h:1",
        "ucx://h:1",
        "inproc://a",
        "tcp://a@h:1",
        "tcp://h:1/x",
        "://",
        ":1",
    ],
)
def test_what_is_no_address_is_refused_before_anything_is_written(
    monkeypatch, capfd, place, address
):
    assert sweep(monkeypatch, capfd, address) == (
        2,
        f"servobench: --scheduler {address}: this is no address of a scheduler: write tcp://HOST:PORT or tls://HOST:PORT\n",
    )
    assert not Path("o").exists()


def test_addresses_as_dask_writes_them():
    assert [check_address(a) for a in ("10.0.0.1:8786", "tcp://[::1]:1", "TLS://h:65535")] == [
        "tcp://10.0.0.1:8786",
        "tcp://[::1]:1",
        "tls://h:65535",
    ]


def silent(peer, kept):
    kept.append(peer)


def speaks_http(peer, kept):
    peer.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
    kept.append(peer)


def hangs_up(peer, kept):
    peer.close()


@pytest.mark.parametrize(
    ("serve", "reason"),
    [
        (silent, "nothing answered within 2 s"),
        (speaks_http, "the server there does not speak Dask's protocol"),
        (hangs_up, "[Errno 104] Connection reset by peer"),
    ],
)
def test_what_is_no_scheduler_is_given_up_at_the_deadline(monkeypatch, capfd, place, serve, reason):
    monkeypatch.setattr(watched, "PATIENCE", 2.0)
    kept = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def accept():
            while True:
                try:
                    serve(server.accept()[0], kept)
                except OSError:
                    return

        threading.Thread(target=accept, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        code, said = sweep(monkeypatch, capfd, address)
        server.shutdown(socket.SHUT_RDWR)
    for peer in kept:
        peer.close()
    begin = f"servobench: --scheduler {address}: no scheduler with workers answers there: "
    assert (code, said[: len(begin)]) == (2, begin)
    assert said.count("\n") == 1
    assert said == f"{begin}{reason}; {ADVICE}\n" or serve is not silent


def test_a_cluster_over_tls_with_dasks_own_configuration(monkeypatch, capfd, place, cluster):
    assert shutil.which("openssl"), "this test makes its certificates with openssl"
    for name in ("mine", "other"):
        subprocess.run(
            [
                "openssl",
                "req",
                "-x509",
                "-newkey",
                "ec",
                "-pkeyopt",
                "ec_paramgen_curve:prime256v1",
                "-nodes",
                "-days",
                "2",
                "-subj",
                "/CN=localhost",
                "-keyout",
                f"{name}.key",
                "-out",
                f"{name}.pem",
            ],
            check=True,
            stderr=subprocess.DEVNULL,
        )
    files = {"CA_FILE": "mine.pem"}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        files |= {f"{role}__CERT": "mine.pem", f"{role}__KEY": "mine.key"}
    for key, name in files.items():
        monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{key}", str(place / name))
    _, address = cluster(protocol="tls")
    words = ["sweep", "mine.toml", "--out", "o", "-q", "--scheduler", address]
    assert ran(words) == (0, "", "")
    assert len(found(Path("o"))) == 2
    shutil.rmtree("o")
    wrong = {
        "other.pem": "no scheduler with workers answers there: [SSL: CERTIFICATE_VERIFY_FAILED] ",
        "none.pem": "Dask's settings of TLS (none.pem, mine.pem, mine.key) cannot be used; correct them: "
        "[Errno 2] No such file or directory\n",
        "": "TLS needs certificates; name their files to Dask by "
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..._TLS__CLIENT__CERT and ..._TLS__CLIENT__KEY, or "
        "in ~/.config/dask\n",
    }
    for authority, sentence in wrong.items():
        tls = {"ca-file": authority, "client.cert": "mine.pem", "client.key": "mine.key"}
        with dask.config.set({f"distributed.comm.tls.{key}": name for key, name in tls.items()}):
            code, said = sweep(monkeypatch, capfd, address)
        begin = f"servobench: --scheduler {address}: {sentence}"
        assert (code, said[: len(begin)], said.count("\n")) == (2, begin, 1)


def test_a_cluster_whose_workers_are_gone_is_given_up_and_one_without_any(
    monkeypatch, place, cluster
):
    started, address = cluster()
    monkeypatch.setattr(watched, "PATIENCE", 5.0)
    with remote(address) as found:
        ends = carry_out(found, range(5), abs)
        assert next(ends)[1] in range(5)
        started[1].kill()
        with pytest.raises(ClusterLost) as lost:
            for _ in ends:
                pass
    assert str(lost.value) == f"the scheduler {address} has had no worker for 5 s"
    with pytest.raises(Mistake) as none, remote(address):
        pass
    assert str(none.value) == (
        f"--scheduler {address}: no scheduler with workers answers there: it had no worker for 5 s; "
        f"{ADVICE}"
    )


def test_more_workers_than_the_machine_holds_are_refused(monkeypatch, capfd, place):
    monkeypatch.setattr(processes, "MEMORY_LIMIT", 24_000_000_000)
    monkeypatch.setattr(processes, "CPU_COUNT", 2)
    sentence = (
        "servobench: --workers 100: this machine has 24.0 GB of memory and 2 cores, and a worker "
        "takes 0.3 GB: use at most 16 workers, best 2\n"
    )
    for words in ("sweep mine.toml", "evaluate clutter", "papers P0-2", "check still --seeds 100"):
        found = call(monkeypatch, capfd, *words.split(), "--workers", "100", "-q")
        assert found == (2, sentence)
    assert [path.name for path in place.iterdir()] == ["mine.toml"]
    processes.check_workers(8)
    processes.check_workers(16)


def test_too_few_open_files_are_named(monkeypatch):
    monkeypatch.setattr(resource, "getrlimit", lambda _: (30, 60))
    with pytest.raises(Refused) as refused:
        processes.check_workers(2)
    assert str(refused.value) == (
        "the workers need 64 open files, and the hard limit is 60: use fewer --workers, or let "
        "root raise this limit (ulimit -Hn 64)"
    )
    set_to = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (30, 64))
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: set_to.append(limits))
    processes.check_workers(2)
    assert set_to == [(64, 64)]

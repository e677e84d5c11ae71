"""Connects to the scheduler of an existing Dask cluster, within a limited time."""

import asyncio
import re
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import Any

from distributed import Client
from distributed.security import Security
from distributed.utils import LoopRunner, sync

from servo.mistake import Mistake
from servo.study.cluster import tasks
from servo.study.cluster.tasks import Cluster, silence

ADDRESS = re.compile(
    r"(?:(tcp|tls)://)?((?:\[[0-9a-f:.]+\]|[^\s/@?#:\[\]]+):([1-9]\d{0,4}))", re.IGNORECASE
)
"""Matches HOST:PORT, with tcp:// or tls:// in front or without."""
TLS_FILES = ("tls_ca_file", "tls_client_cert", "tls_client_key")
CONNECTING = 0.75
"""Share of the allowed time after which Dask gives up connecting and reports the reason."""
CLOSING = 2.0
"""Longest wait for closing the connection to a scheduler that does not answer [s]."""


def check_address(text: str) -> str:
    """Return the address of a Dask scheduler as Dask writes it: "tcp://host:8786" for "host:8786",
    which has no protocol.

    Raises:
        Mistake: The text is not HOST:PORT, tcp://HOST:PORT or tls://HOST:PORT.
    """
    found = ADDRESS.fullmatch(text)
    if found is None or int(found[3]) >= 1 << 16:  # no port
        raise Mistake(
            f"--scheduler {text}: this is no address of a scheduler: write tcp://HOST:PORT or "
            "tls://HOST:PORT"
        )
    return f"{(found[1] or 'tcp').lower()}://{found[2]}"


@contextmanager
def remote(text: str) -> Generator[Cluster]:
    """Context manager that connects to the Dask cluster whose scheduler has the address `text`,
    such as "tcp://host:8786", yields the cluster, and disconnects at the end of the block.

    Raises:
        Mistake: The text is no address, no scheduler with a worker answers there within 20 s, or
            the user's TLS settings of Dask cannot be used.
        ClusterLost: A worker has several threads.
    """
    address = check_address(text)
    with silence():
        security = security_of(address)
        runner: Any = LoopRunner()
        runner.start()
        try:
            client = sync(runner.loop, _reach, address, security)
            name = f"the scheduler {address}"
            lost = f"{name} has had no worker for {tasks.PATIENCE:g} s"
            found = Cluster(client, name, tasks.Patience(tasks.PATIENCE, lost))
            try:
                found.workers()
                yield found
            finally:
                with suppress(OSError):  # a TimeoutError is one
                    client.close(CLOSING)
        finally:
            runner.stop()


def security_of(address: str) -> Security:
    """Return the user's TLS settings of Dask, for connecting to a scheduler.

    Args:
        address: Address of the scheduler, such as "tls://host:8786".

    Raises:
        Mistake: The settings cannot be used, or lack certificates that a tls:// address needs.
    """
    names: list[str] = []
    try:
        security = Security()
        names += [name for attribute in TLS_FILES if (name := getattr(security, attribute))]
        security.get_connection_args("client")  # reads the files
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise Mistake(
            f"--scheduler {address}: Dask's settings of TLS "
            f"({', '.join(names) or 'distributed.comm.tls'}) cannot be used; correct them: {error}"
        ) from None
    if address.startswith("tls") and not (security.tls_ca_file and security.tls_client_cert):
        raise Mistake(
            f"--scheduler {address}: TLS needs certificates; name their files to Dask by "
            "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..._TLS__CLIENT__CERT and ..._TLS__CLIENT__KEY, "
            "or in ~/.config/dask"
        )
    return security


async def _reach(address: str, security: Security) -> Client:
    """Connect to a scheduler, wait for its first worker, and return the client.

    Raises:
        Mistake: No scheduler with workers answers within `tasks.PATIENCE` seconds.
    """
    client: Any = Client(
        address,
        security=security,
        timeout=CONNECTING * tasks.PATIENCE,
        asynchronous=True,
        set_as_default=False,
    )
    said = f"nothing answered within {tasks.PATIENCE:g} s"
    try:
        async with asyncio.timeout(tasks.PATIENCE):
            await client
            said = f"it had no worker for {tasks.PATIENCE:g} s"
            await client.wait_for_workers(1)
        return client
    except Exception as error:  # anything may answer there
        with suppress(Exception):
            await client.close(CLOSING)
        if isinstance(error, OSError | ImportError) and not isinstance(error, TimeoutError):
            said = tasks.reason(error)
        elif not isinstance(error, TimeoutError):
            said = "the server there does not speak Dask's protocol"
    raise Mistake(
        f"--scheduler {address}: no scheduler with workers answers there: {said}; start a "
        "scheduler and a worker there, or correct the address or, for tls://, the certificates"
    )

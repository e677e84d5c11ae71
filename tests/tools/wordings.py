"""Names for the long lists in sentences: a table of sentences stays short and exact."""

from __future__ import annotations

import re

from hostile import LONG

from servo.cli.list_command import PARTS
from servo.loop.measure import MEASURES
from servo.papers.claims import CLAIMS
from servo.scenario.catalogue import LISTS, PLUGINS, shipped, studies
from servo.scenario.load import KEYS


def _listed() -> dict[str, str]:
    lists = {
        "LISTED": dict.fromkeys((*PARTS, *KEYS)),
        "SCENARIOS": shipped(),
        "STUDIES": studies(),
        "MEASURES": MEASURES,
        "CLAIMS": [claim.name for claim in CLAIMS],
        "SECTIONS": KEYS,
    }
    folders = {name: folder for name, (folder, _) in PLUGINS.items()}
    folders["disturbance"] = LISTS["disturbances"]
    lists |= {f"{name.upper()}_KINDS": folder.names() for name, folder in folders.items()}
    return {f"<{name}>": ", ".join(names) for name, names in lists.items()} | {"<LONG>": LONG}


LISTED = _listed()
MACHINE = re.compile(
    r"this machine has [0-9.]+ GB of memory and \d+ cores, and a worker takes "
    r"[0-9.]+ GB: use at most \d+ workers, best \d+"
)


def folded(sentence: str) -> str:
    """A sentence with its long lists, and what differs between machines, named."""
    for name, words in LISTED.items():
        sentence = sentence.replace(words, name)
    return MACHINE.sub("<MACHINE>", sentence)

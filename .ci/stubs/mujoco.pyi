"""MuJoCo's names come from compiled modules without stubs: each is taken as it is."""

from typing import Any

def __getattr__(name: str) -> Any: ...

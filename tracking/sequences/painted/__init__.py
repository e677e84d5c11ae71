"""Painted sequences with exact truth; each file is one family."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__)

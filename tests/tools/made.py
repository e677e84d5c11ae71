"""Parts made by a function, for tests of what parts may get wrong."""

from dataclasses import dataclass


def config_for(make):
    """A `Config` class whose build gives what a function makes."""

    @dataclass(frozen=True)
    class Config:
        def build(self, rng):
            return make(rng)

    return Config

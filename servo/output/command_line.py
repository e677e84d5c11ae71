"""The command line that makes a result again, as it is stored with the result."""

from __future__ import annotations

import shlex


def command_line(command: str, *words: str, **options: object) -> str:
    """A command as a shell takes it.

    Args:
        command: Such as "bench".
        words: Its arguments.
        options: By name; True is a flag, a list or a tuple repeats the option, None and False leave
            it out.
    """
    given: list[str] = []
    for name, value in options.items():
        values = value if isinstance(value, list | tuple) else [value]
        for one in values:
            if one is not None and one is not False:
                given += [f"--{name.replace('_', '-')}", *([] if one is True else [str(one)])]
    if any(word.startswith("-") for word in words):  # they would be taken for options
        return shlex.join(["servobench", command, *given, "--", *words])
    return shlex.join(["servobench", command, *words, *given])

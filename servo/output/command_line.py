"""The command line that repeats a result, as it is stored with the result."""

from __future__ import annotations

import shlex


def command_line(command: str, *words: str, **options: object) -> str:
    """A command line for a shell.

    Args:
        command: The command, such as "bench".
        words: Its arguments.
        options: Its options by name; True is a flag, a list or a tuple repeats the option, None and
            False leave it out.
    """
    given: list[str] = []
    for name, value in options.items():
        values = value if isinstance(value, list | tuple) else [value]
        for one in values:
            if one is not None and one is not False:
                given += [f"--{name.replace('_', '-')}", *([] if one is True else [str(one)])]
    if any(word.startswith("-") for word in words):  # else it would be read as an option
        return shlex.join(["servobench", command, *given, "--", *words])
    return shlex.join(["servobench", command, *words, *given])

"""The code of a tutorial page: the files that it says to save, and one script of all the rest."""

import re

BLOCK = re.compile(r"(Save as\s+`(?P<file>[\w./]+)`:\n\n)?^```(\w+)\n(.*?)^```$", re.M | re.S)


def saved_files(page):
    """Contents by name of the blocks that a page says to save."""
    return {file: code for _, file, _, code in BLOCK.findall(page) if file}


def script(page):
    """Python blocks and shell blocks of a page, in order, as one Python script."""
    parts = ["import subprocess"]
    for _, file, language, code in BLOCK.findall(page):
        if language == "python" and not file:
            parts.append(code)
        elif language == "sh":
            parts.append(f'subprocess.run(["bash", "-ec", {code!r}], check=True)')
    return "\n".join(parts)

"""Texts that tests compare with: pages and outputs, one file each.

`RECORD=1 pytest tests/report tests/text` writes them again; review the difference like code.
"""

import os
from difflib import ndiff
from pathlib import Path


def recorded(name: str, text: str) -> str:
    """Return the recorded text of a name; with RECORD set, record this one first."""
    path = Path(__file__).with_name(f"{name}.txt")
    if os.environ.get("RECORD"):
        path.write_text(text, encoding="utf-8")
    return path.read_text(encoding="utf-8")


def changes(before: list[str], after: list[str]) -> list[str]:
    """Return the lines that differ, each once, with the sign of a patch."""
    return [*dict.fromkeys(line for line in ndiff(before, after) if line[0] in "-+")]

"""Message codes: everything that a check reports, with cause and remedy, from codes.toml.

XC1xx is what the audit finds in a file, XC2xx the cause of a difference, XC3xx a case that differs
or is unresolved, XC4xx a file that is refused or not read, XC5xx a change since the baseline, and
XC6xx a run that failed. A record's code follows from its kind, by this table.

The site has a page for each code (`results.messages`).
"""

import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from .base import Record

_FILE = Path(__file__).with_name("codes.toml")


class Code(Record, frozen=True, kw_only=True):
    """A message that a check can report.

    Attributes:
        code: `XC` with three digits; it never changes its meaning.
        name: the same in words, as `wrong-number`.
        title: one sentence.
        cause: why it happens, and how engines behave.
        example: an excerpt of a file, or output.
        remedy: what to do.
        kinds: what reports it, as `audit:literal`, `cause:axis` or `case:DIFFERS:motion`.
    """

    code: str
    name: str
    title: str
    cause: str
    example: str
    remedy: str
    kinds: tuple[str, ...]


GROUPS: Mapping[str, str] = MappingProxyType(
    {
        "XC1": "Findings of the audit",
        "XC2": "Causes of a difference",
        "XC3": "Cases that differ or are unresolved",
        "XC4": "Files that are refused or not read",
        "XC5": "Changes since the baseline",
        "XC6": "Runs that failed",
    }
)
"""Title of each group, by the first characters of its codes."""


def finding_code(kind: str) -> str:
    """Return the code of an audit finding; empty for an unknown kind."""
    return _by_kind().get(f"audit:{kind}", "")


def cause_code(kind: str) -> str:
    """Return the code of a cause; empty for an unknown kind."""
    return _by_kind().get(f"cause:{kind}", "")


def case_code(outcome: str, kind: str) -> str:
    """Return the code of a case: by its kind, or else by its outcome; empty where it agrees."""
    exact = _by_kind().get(f"case:{outcome}:{kind}")
    return exact or _by_kind().get(f"case:{outcome}:", "")


def comparison_code(outcome: str, kind: str) -> str:
    """Return the code of a comparison of two files; empty where they agree."""
    return _by_kind().get(f"comparison:{outcome}") or case_code(outcome, kind)


def gate_code(status: str, kinds: Sequence[str]) -> str:
    """Return the code of a case in the gate: by its status, and what changed first."""
    first = next((kind for kind in kinds if kind != "text"), "")
    exact = _by_kind().get(f"gate:{status}:{first}")
    return exact or _by_kind().get(f"gate:{status}:", "")


def part_code() -> str:
    """Return the code of an audit or a linearization that failed."""
    return _by_kind()["part:failed"]


@lru_cache(maxsize=1)
def codes() -> Mapping[str, Code]:
    """Return every message, by its code."""
    tables = tomllib.loads(_FILE.read_text(encoding="utf-8"))
    return MappingProxyType({code: _code(code, table) for code, table in tables.items()})


@lru_cache(maxsize=1)
def _by_kind() -> Mapping[str, str]:
    return {kind: one.code for one in codes().values() for kind in one.kinds}


def _code(code: str, table: dict[str, Any]) -> Code:
    prose = {key: " ".join(table[key].split()) for key in ("cause", "remedy")}
    example = table["example"].strip("\n")
    return Code(
        code=code,
        name=table["name"],
        title=table["title"],
        example=example,
        kinds=tuple(table["kinds"]),
        **prose,
    )

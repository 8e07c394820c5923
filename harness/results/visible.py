"""Text as a person is to see it: nothing in a name may write to a terminal, or turn it around."""

from __future__ import annotations

import unicodedata

_TURNING = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that change the direction of what is shown (Unicode's bidirectional controls)."""


def odd_name(name: str) -> str | None:
    """What a name has in it that no name of a file here may have; None where it is in order."""
    for c in name:
        if c in _TURNING:
            return f"a character that turns the text around ({c!a})"
        match unicodedata.category(c):
            case "Cc" | "Zl" | "Zp":
                return f"a control character ({c!a})"
            case "Cs":
                return "bytes that are not UTF-8"
    return None


def visible(text: str) -> str:
    """A text in which what no name may have is escaped, line ends too."""
    if text.isprintable():
        return text
    return "".join(ascii(c)[1:-1] if odd_name(c) else c for c in text)


def visible_lines(text: str) -> list[str]:
    """The lines of a text, each as above; tabs are spaces."""
    return [visible(line) for line in text.expandtabs().splitlines()]

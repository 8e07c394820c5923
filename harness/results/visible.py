"""Text without invisible or dangerous characters, such as terminal controls in names."""

import unicodedata

_TURNING = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that change the direction of text (Unicode's bidirectional controls)."""


def odd_name(name: str) -> str | None:
    """Return the forbidden part of a file name; None for a valid name."""
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
    """Escape forbidden characters of a text, including line ends."""
    if text.isprintable():
        return text
    return "".join(ascii(c)[1:-1] if odd_name(c) else c for c in text)


def visible_lines(text: str) -> list[str]:
    """Split a text into lines, each escaped as by `visible`, with tabs as spaces."""
    return [visible(line) for line in text.expandtabs().splitlines()]

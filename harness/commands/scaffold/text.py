"""Text of a model file as comments and literals of a new folder."""

import json
import textwrap

_WIDTH = 100


def comment(text: str) -> list[str]:
    """Return the lines of a comment."""
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.split()), _WIDTH - 2)]


def literal(value: object) -> str:
    """Format a setting as TOML."""
    return quoted(value) if isinstance(value, str) else json.dumps(value)


def plain(text: str) -> str:
    """Make text safe for a comment: one line, without hidden characters."""
    return "".join(c if c.isprintable() else "?" for c in text)


def quoted(text: str) -> str:
    """Return a string literal that Python and TOML read as the same text, for any name of a joint.

    Lone surrogates, from file names that are not UTF-8, become question marks, since TOML has none.
    """
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(c: str) -> str:
    if c in '"\\':
        return f"\\{c}"
    if c.isprintable():
        return c
    code = ord(c)
    if 0xD800 <= code < 0xE000:
        return "?"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"

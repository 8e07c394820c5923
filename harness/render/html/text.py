"""Format values, names and ids: short numbers, safe names, linkable ids."""

from __future__ import annotations

import string

NOTHING = "–"
"""Text for a missing value."""

_SAFE = frozenset(string.ascii_letters + string.digits + "._-")
# Embeddings, overrides, isolates and marks: they reorder the text around them.
_DIRECTION = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def shown(value: object) -> str:
    """Make text safe for a page: control and direction characters become visible.

    Markup is unchanged; the template escapes it.
    """
    text = str(value)
    return text if text.isprintable() else "".join(map(_visible, text))


def _visible(c: str) -> str:
    code = ord(c)
    if c in "\n\t" or (0x20 <= code < 0x7F):
        return c
    if code < 0x20:
        return chr(0x2400 + code)
    if code == 0x7F:
        return "\u2421"
    if code < 0xA0 or c in _DIRECTION or 0xD800 <= code < 0xE000:
        return f"⟨U+{code:04X}⟩"
    return c


def slug(*parts: str) -> str:
    """Join parts of a name to one id with slashes; different parts give different ids."""
    return "/".join("".join(c if c in _SAFE else f"~{ord(c):x}~" for c in part) for part in parts)


def sci(value: float | None) -> str:
    """Format two digits and an exponent, as in the terminal."""
    if value is None:
        return NOTHING
    return "0" if value == 0 else f"{value:.1e}"


def exact(value: float | None) -> str:
    """Format a number as in a file, with nine digits."""
    return "?" if value is None else f"{value:.9g}"


def percent(value: float | None) -> str:
    """Format percent with three digits; very small or large values get an exponent."""
    if value is None:
        return NOTHING
    if value == 0 or 1e-6 <= abs(value) < 100:
        return f"{100 * value:.3g}\u00a0%"
    return f"{value:.1e}"


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """Format a number with its unit."""
    return NOTHING if value is None else f"{value:.{digits}g}\u00a0{unit}".rstrip()


def complex_number(real: float | None, imaginary: float | None, paired: bool) -> str:
    """Format a pole, with `paired` for a conjugate pair, without a real part from rounding."""
    if real is None or imaginary is None:
        return NOTHING
    if abs(real) < 1e-9 * abs(imaginary):
        real = 0.0
    sign = "±" if paired else ("-" if imaginary < 0 else "+")
    tail = f" {sign} {abs(imaginary):.6g}i" if imaginary or paired else ""
    return f"{real:.6g}{tail}"

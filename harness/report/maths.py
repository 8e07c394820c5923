"""MathML from results, made safe: rebuilt from the elements that mathematics needs alone.

Results may come from anywhere; what is put on the page unescaped must not be able to act.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring
from markupsafe import Markup, escape

from harness.report.text import shown

_NAMES = """mrow mi mn mo mtext mspace mfrac msqrt mroot msub msup msubsup mover munder munderover
mtable mtr mtd"""
ELEMENTS = frozenset(_NAMES.split())
INVISIBLE_TIMES = "\u2062"
ATTRIBUTES = {"mover": {"accent": "true"}}


def maths(mathml: str | None, text: str, block: bool = False) -> Markup:
    """Written mathematics as an element of the page; plain text where it can't be read.

    Args:
        mathml: presentation MathML as results have it, or None.
        text: the same as plain text.
        block: whether it stands by itself.
    """
    plain = Markup('<span class="code">{}</span>').format(shown(text))
    if not mathml:
        return plain
    try:
        root = fromstring(mathml)
        inner = _safe(root)
    except (ParseError, DefusedXmlException, ValueError):
        return plain
    display = Markup(' display="block"') if block else ""
    return Markup("<math{}>{}</math>").format(display, inner)


def _safe(element: Element) -> Markup:
    if element.tag not in ELEMENTS:
        raise ValueError(f"{element.tag!r} is no element of mathematics")
    wanted = ATTRIBUTES.get(str(element.tag), {})
    kept = [f' {name}="{value}"' for name, value in wanted.items() if element.get(name) == value]
    if element.tag == "mo" and element.text == INVISIBLE_TIMES:
        # Factors of several letters would run into each other.
        kept.append(' rspace="0.14em"')
    parts = [escape(shown(element.text or ""))] if len(element) == 0 else []
    parts += [_safe(child) for child in element]
    tag = Markup(str(element.tag))
    return Markup("<{}{}>{}</{}>").format(tag, Markup("".join(kept)), Markup("").join(parts), tag)

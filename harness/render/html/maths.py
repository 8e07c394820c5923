"""Convert LaTeX to MathML, which browsers typeset.

Results may come from an untrusted source, and latex2mathml copies text including markup. The output
is therefore rebuilt from its tree: only elements that mathematics needs, with escaped text.
"""

from __future__ import annotations

import html
from functools import lru_cache
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert_to_element
from markupsafe import Markup

from .text import shown

_GROUPS = frozenset(["mrow", "mtd"])
_OPERANDS = frozenset(
    ["mrow", "mi", "mn", "mtext", "mfrac", "msqrt", "mroot", "msub", "msup", "msubsup", "mover"]
)
ELEMENTS = _GROUPS | _OPERANDS | frozenset(["mo", "munder", "munderover", "mtable", "mtr"])
_PARTS = {"mfrac": 2, "mroot": 2, "msub": 2, "msup": 2, "mover": 2, "munder": 2, "msubsup": 3}
_KEPT = {"mo": ("stretchy", "fence", "form"), "mi": ("mathvariant",)}
_VALUES = frozenset(["true", "false", "prefix", "postfix", "normal"])

# The space separates factors of several letters.
_TIMES = Markup('<mo rspace="0.14em">\u2062</mo>')
_APPLY = Markup("<mo>\u2061</mo>")


@lru_cache(maxsize=4096)
def mathml(latex: str, block: bool = False) -> Markup:
    """Convert LaTeX to an element of the page; return the LaTeX itself if it can't be parsed.

    Args:
        latex: a formula without delimiters.
        block: whether it is a separate block.
    """
    display = Markup(' display="block"') if block else Markup("")
    try:
        return Markup("<math{}>{}</math>").format(display, _group(convert_to_element(latex)))
    except Exception:  # The converter raises many types: IndexError, StopIteration, its own.
        return Markup("<code>{}</code>").format(shown(latex))


def _group(element: Element) -> Markup:
    """Convert the content of an element, with the omitted multiplication and application signs."""
    written = Markup("")
    before: Element | None = None
    for child in _bracketed(list(map(_bare, element))):
        if child.tag == "mspace":  # TeX's thin space between factors; the spaces are added below
            continue
        if before is not None and before.tag in _OPERANDS and child.tag in _OPERANDS:
            written += _APPLY if _is_function(before) else _TIMES
        if before is not None and _sign(before) == "=" and _sign(child) in ("+", "−"):
            child.set("form", "prefix")  # not an operation there
        written += _element(child)
        before = child
    return written


def _bracketed(elements: list[Element]) -> list[Element]:
    """Group each matrix with its brackets, so that the brackets grow to its height only."""
    if len(elements) <= 3:  # a single matrix
        return elements
    grouped: list[Element] = []
    for element in elements:
        if len(grouped) > 1 and grouped[-1].tag == "mtable" and element.tag == "mo":
            matrix = Element("mrow")
            matrix.extend([grouped.pop(-2), grouped.pop(), element])
            element = matrix
        grouped.append(element)
    return grouped


def _sign(element: Element) -> str:
    return html.unescape(element.text or "") if element.tag == "mo" else ""


def _element(element: Element) -> Markup:
    tag = str(element.tag)
    if tag not in ELEMENTS:
        raise ValueError(f"{tag!r} is not a MathML element")
    if len(element) != _PARTS.get(tag, len(element)):
        raise ValueError(f"{tag!r} lacks a part")
    text = html.unescape(element.text or "")  # operators are given as references
    if text.startswith("\\"):
        raise ValueError(f"unknown command {text!r}")
    if tag in _GROUPS:
        inner = _group(element)
    elif len(element):
        inner = Markup("").join(_element(_bare(child)) for child in element)
    else:
        inner = Markup.escape(shown(text))
    return Markup("<{0}{1}>{2}</{0}>").format(Markup(tag), _attributes(element), inner)


def _attributes(element: Element) -> Markup:
    tag = str(element.tag)
    kept = [
        f' {name}="{element.attrib[name]}"'
        for name in _KEPT.get(tag, ())
        if element.get(name) in _VALUES
    ]
    if tag == "mover":  # accents such as dots belong close above the letter
        kept.append(' accent="true"')
    return Markup("".join(kept))


def _bare(element: Element) -> Element:
    """Return an element without groups of one element around it."""
    while element.tag == "mrow" and len(element) == 1:
        element = element[0]
    return element


def _is_function(element: Element) -> bool:
    """Return whether an element is a function name such as cos, or a power of one."""
    if element.tag == "msup":
        element = _bare(element[0])
    return element.tag == "mi" and len(html.unescape(element.text or "")) > 1

"""Numbers in XML, by paths such as `body[rod]/inertial@pos[2]`."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress

from physics_crosscheck.harness.documents.elements import (
    XmlElement,
    attribute_span,
    read_elements,
    text_span,
)
from physics_crosscheck.harness.documents.errors import LocationError, quote, truncate
from physics_crosscheck.harness.documents.reading import DECIMAL, Resolve, SourceFile, Span, nearest

_STEP = re.compile(r"([^\s/@\[\]]+)(?:\[([^\]]+)\])?")
_ADDRESS = re.compile(
    rf"(?P<steps>{_STEP.pattern}(?:/{_STEP.pattern})*)"
    r"(?:@(?P<attribute>[^\s/@\[\]]+)(?:\[(?P<index>\d{1,9})\])?)?"
)


def xml_paths(source: SourceFile) -> Resolve:
    """Return a resolver of numbers in attributes and elements; expat parses them and gives their
    places.
    """
    elements = read_elements(source)

    def resolve(address: str) -> tuple[Span, float]:
        match = _ADDRESS.fullmatch(address)
        if match is None:
            raise source.error(
                address, "is not an address; write it like 'body[rod]/inertial@pos[2]'"
            )
        steps, index = _steps(match, elements)
        matches = _walk(elements, steps, address, source)
        attribute = match["attribute"]
        if attribute is not None:
            having = [element for element in matches if attribute in element.attributes]
            if not having:
                first = matches[0]
                near = nearest(attribute, first.attributes) or "none"
                raise source.error(
                    address,
                    f"names <{first.tag}>, which has no {attribute}; it has {near}",
                    first.start,
                )
            matches = having
        if len(matches) > 1:
            depth = len(steps) + (len({e.spelled(len(steps)) for e in matches}) < len(matches))
            spelled = ", ".join(dict.fromkeys(e.spelled(depth) for e in matches))
            raise source.error(
                address,
                f"names several numbers ({source.lines(e.start for e in matches)}); "
                f"add its name or its parent's ({spelled})",
                matches[0].start,
            )
        if attribute is not None:
            spans, words = attribute_words(matches[0], attribute, source, address)
            what = attribute
        else:
            spans, words = text_words(matches[0], source, address)
            what = f"<{matches[0].tag}>"
        return _component(spans, words, match["index"] or index, what, address, source)

    return resolve


def _steps(
    match: re.Match[str], elements: Sequence[XmlElement]
) -> tuple[list[tuple[str, str | None]], str | None]:
    """Return tags with names, and the index of a number of the last one's text, as in
    `link[rod]/pose[2]`.

    It is a name if an element has that name.
    """
    steps = [(tag, name or None) for tag, name in _STEP.findall(match["steps"])]
    tag, name = steps[-1]
    listed = name is not None and re.fullmatch(r"\d{1,9}", name) and not match["attribute"]
    if not listed or any(e.tag == tag and e.identity is not None for e in elements):
        return steps, None
    return [*steps[:-1], (tag, None)], name


def xml_offset(source: SourceFile, address: str) -> int | None:
    """Return the first byte of the first element, or attribute, of an address.

    If no such element has the attribute, return the element: its number is a default, or computed.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        return None
    elements = read_elements(source)
    steps, _ = _steps(match, elements)
    pool, matches = iter(elements), list[XmlElement]()
    for tag, name in steps:
        matches = [e for e in pool if e.tag == tag and name in (None, e.identity)]
        pool = (child for e in matches for child in _within(e))
    attribute = match["attribute"]
    for element in matches:
        if attribute in element.attributes:
            return attribute_span(element, attribute, source)[0]
    return matches[0].start if matches else None


def _within(element: XmlElement) -> Iterator[XmlElement]:
    """Yield children; MJCF's <frame> only groups them."""
    for child in element.children:
        yield child
        if child.tag == "frame":
            yield from _within(child)


def xml_numbers(source: SourceFile, kinds: re.Pattern[str]) -> Iterator[str]:
    """Yield addresses of numbers whose element and attribute, as in `joint@damping`, match `kinds`.

    For an element's text, the kind is its tag. Numbers that no name distinguishes have no address.
    """
    resolve = xml_paths(source)
    for element in read_elements(source):
        words = {f"@{name}": text.split() for name, text in element.attributes.items()}
        words[""] = [] if element.children else element.text.split()
        for attribute, values in words.items():
            if kinds.fullmatch(element.tag + attribute):
                for index, value in enumerate(values):
                    if DECIMAL.fullmatch(value):
                        ending = attribute + (f"[{index}]" if len(values) > 1 else "")
                        yield from _address(resolve, element, ending)


def _address(resolve: Resolve, element: XmlElement, ending: str) -> Iterator[str]:
    """Yield the shortest address of this element, preferring one that begins with a name."""
    spelled = [element.spelled(steps) for steps in range(1, element.depth + 1)]
    for path in sorted(spelled, key=lambda path: "[" not in path.split("/")[0]):
        with suppress(LocationError):
            resolve(path + ending)
            yield path + ending
            return


def _walk(
    elements: Sequence[XmlElement],
    steps: list[tuple[str, str | None]],
    address: str,
    source: SourceFile,
) -> list[XmlElement]:
    """Return the elements that match the steps of an address, at least one."""
    pool, parents = list(elements), list[XmlElement]()
    for tag, name in steps:
        matches = [e for e in pool if e.tag == tag and name in (None, e.identity)]
        if not matches:
            step = tag if name is None else f"{tag}[{name}]"
            within = f" in {parents[0].spelled(1)}" if parents else ""
            near = [e.spelled(1) for e in pool if e.tag == tag and e.identity is not None]
            near = near or [e.spelled(1) for e in pool]
            raise source.error(
                address,
                f"names nothing: there is no {truncate(step)}{truncate(within)}; nearest: "
                f"{nearest(step, near) or 'nothing'}",
                parents[0].start if parents else None,
            )
        parents, pool = matches, [child for e in matches for child in e.children]
    return matches


def attribute_words(
    element: XmlElement, attribute: str, source: SourceFile, address: str
) -> tuple[list[Span], list[str]]:
    """Return the spans of the words of an attribute's value, and the parser's words."""
    spans = find_words(source, *attribute_span(element, attribute, source), address)
    return spans, element.attributes[attribute].split()


def text_words(
    element: XmlElement, source: SourceFile, address: str
) -> tuple[list[Span], list[str]]:
    """Return the same for an element's text."""
    if element.children:
        remedy = "end the address with an attribute, as in '@mass', or with one of its elements"
        raise source.error(
            address, f"names <{element.tag}>, which is not a number; {remedy}", element.start
        )
    if not element.text.strip():
        near = nearest("", element.attributes)
        remedy = f"; its attributes are {near}, as in '@{near.split(', ')[0]}'" if near else ""
        raise source.error(
            address, f"names <{element.tag}>, which has no text{remedy}", element.start
        )
    return find_words(source, *text_span(element, source), address), element.text.split()


def find_words(source: SourceFile, start: int, end: int, address: str) -> list[Span]:
    """Return the spans of words between two bytes, without comments."""
    written = source.data[start:end]
    if re.search(rb"&|<!\[CDATA\[", written):
        raise source.error(
            address, "is written with a reference or CDATA; write a plain number", start
        )
    written = re.sub(rb"<!--.*?-->|<\?.*?\?>", lambda m: b" " * len(m[0]), written, flags=re.DOTALL)
    return [(start + m.start(), start + m.end()) for m in re.finditer(rb"[^ \t\r\n]+", written)]


def _component(
    spans: list[Span],
    words: list[str],
    index: str | None,
    what: str,
    address: str,
    source: SourceFile,
) -> tuple[Span, float]:
    count = len(spans)
    start = spans[0][0] if spans else None
    if index is None and count != 1:
        raise source.error(
            address, f"names {count} numbers; choose one, as in '{address}[0]'", start
        )
    place = int(index or 0)
    if place >= count:
        raise source.error(address, f"is beyond {what}: it has {count} numbers, from [0]", start)
    if len(words) != count:
        raise source.error(
            address, f"is interrupted by a comment in {what}; move the comment out", start
        )
    try:
        # Python would read 1_000; XML readers do not.
        return spans[place], float(words[place].replace("_", "?"))
    except ValueError:
        reason = f"is {quote(words[place])}; expected a number"
        raise source.error(address, reason, spans[place][0]) from None

"""A model file as elements with lines, read as tolerantly as engines read it; links and joints."""

import math
import re
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from physics_crosscheck.reference.mechanism.bodies import RigidBody
from .elements import XmlElement, read_repaired
from .errors import LocationError, ReadError, ReadKind, quote
from .reading import DECIMAL, MAX_MODEL_BYTES, SourceFile, read_regular

_UNEXPANDED = re.compile(r"\$[({]")
EXPAND = "expand it first: xacro FILE > robot.urdf"


class Document:
    """A file's elements, and the problems found in them.

    Args:
        path: of the file.
        written: its bytes; None: they are read.

    Attributes:
        path: of the file.
        source, data: its bytes; if these are not XML, repaired ones, as UTF-8 with unchanged lines.
        omitted: number of bytes of the file before these: those of a byte order mark.
        elements: all of them, in order; change only copies of them.
        obstacles: problems so far.
        repeated: elements without effect, since another one of their tag comes first.
        armatures: inertia of rotors, by joint, kg or kg m^2, that the file states for one engine.

    Raises:
        LocationError: for a file that can't be read, or is not XML.
    """

    def __init__(self, path: Path, written: bytes | None = None) -> None:
        self.path = path
        self.obstacles: list[ReadError] = []
        self.repeated: dict[XmlElement, ReadError] = {}
        self.armatures: Mapping[str, float] = {}
        try:
            written = read_regular(path, MAX_MODEL_BYTES) if written is None else written
        except OSError as error:
            raise LocationError(f"can't be read: {error.strerror or error}", file=path) from None
        self.source, self.elements = read_repaired(SourceFile(path, written))
        self.data = self.source.data
        repaired = self.data is not written
        self.omitted = len(BOM_UTF8) if repaired and written.startswith(BOM_UTF8) else 0

    @property
    def root(self) -> XmlElement:
        """The first element."""
        return self.elements[0]

    def line(self, element: XmlElement) -> int:
        """Return the line of an element, from 1."""
        return self.source.line(element.start)

    def add_problem(
        self, element: XmlElement, sentence: str, remedy: str, kind: ReadKind = "robot"
    ) -> None:
        """Add a problem that prevents building a tree."""
        self.obstacles.append(self._problem(element, sentence, remedy, kind))

    def _problem(
        self, element: XmlElement, sentence: str, remedy: str, kind: ReadKind = "robot"
    ) -> ReadError:
        line = self.line(element)
        return ReadError(sentence=sentence, file=self.path, line=line, remedy=remedy, kind=kind)

    def child(self, element: XmlElement | None, path: str) -> XmlElement | None:
        """Return the element at a path of tags, such as `axis/limit`, or None.

        Of several children of one tag, the first counts, as in engines; others are `repeated`.
        """
        for tag in path.split("/"):
            if element is None:
                return None
            children = element.findall(tag)
            for other in children[1:]:
                if other.content != children[0].content and other not in self.repeated:
                    place = element.spelled(1 if element.identity else min(element.depth, 2))
                    sentence = f"a second <{tag}> in {place} has no effect"
                    self.repeated[other] = self._problem(other, sentence, "keep one of them")
            element = children[0] if children else None
        return element

    def numbers(
        self, element: XmlElement | None, key: str, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """Return as many finite numbers of an attribute as the default has, or the default."""
        text = None if element is None else element.attributes.get(key)
        if element is None or text is None:
            return default
        return self.parsed(element, f"{key} of {what}", text, default)

    def text_numbers(
        self, element: XmlElement | None, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """Return as many finite numbers of an element's text as the default has, or the default."""
        if element is None or not element.text.strip():
            return default
        return self.parsed(element, f"<{element.tag}> of {what}", element.text.strip(), default)

    def parsed(
        self, element: XmlElement, place: str, text: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return as many finite numbers of a text as the default has.

        Another text is a problem of its element, and gives the default. `place` begins the message.
        """
        count = len(default)
        values = read_numbers(text, count)
        if values is not None:
            return values
        wanted, remedy = "a finite number", "write a number"
        if count > 1:
            wanted = f"{count} finite numbers"
            remedy = f"write {count} numbers, separated by spaces"
        self.add_problem(
            element,
            f"{place} is {quote(text)}; expected {wanted}",
            EXPAND if _UNEXPANDED.search(text) else remedy,
            "file",
        )
        return default

    def number(self, element: XmlElement | None, key: str, default: float, what: str) -> float:
        """Return one number of an attribute."""
        return self.numbers(element, key, (default,), what)[0]


@lru_cache(maxsize=4096)  # changed copies of a file share nearly all their texts
def read_numbers(text: str, count: int) -> tuple[float, ...] | None:
    """Return `count` finite numbers, or None if the text is anything else."""
    numbers = finite_numbers(text)
    return None if numbers is None or len(numbers) != count else tuple(numbers)


def finite_numbers(words: str) -> list[float] | None:
    """Return the numbers that a text lists, or None if one is not a finite number.

    A comma may follow a number before a blank, as in "1, 2, 3", which some engines read. They read
    "1,2,3" as 0 0 0 and "1 ,2 ,3" as 1 0 0, so these are not numbers.
    """
    *before, last = words.split() or [""]
    parts = [*(word.removesuffix(",") for word in before), last] if last else []
    numbers = [float(w) if DECIMAL.fullmatch(w) else math.nan for w in parts]
    return numbers if all(map(math.isfinite, numbers)) else None


GRAVITY = (0.0, 0.0, -9.81)
"""Gravity of a file that states none, m/s^2."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: joint = multiplier * leader + offset."""

    joint: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FileLink:
    """A link of a file: its element, and its body, which has no parent yet."""

    element: XmlElement
    body: RigidBody


def free_name(root: str, joints: Iterable[str]) -> str:
    """Return the name of a floating root's free joint: the root's, unless a joint has it."""
    names = set(joints)
    while root in names:
        root += "_free"
    return root


def named_elements(
    document: Document, elements: Iterable[XmlElement], kind: str, reserved: Iterable[str] = ()
) -> dict[str, XmlElement]:
    """Return elements by name; missing and repeated names are noted.

    Args:
        document: the file.
        elements: some elements of it.
        kind: of elements that may not share a name, for messages.
        reserved: names that no element may have.
    """
    by_name: dict[str, XmlElement] = {}
    for element in elements:
        name = element.get("name")
        if not name:
            document.add_problem(element, f"a <{element.tag}> has no name", "give it a unique name")
        elif name in by_name or name in reserved:
            document.add_problem(
                element, f"a second {kind} is called {quote(name)}", "give it a unique name"
            )
        else:
            by_name[name] = element
    return by_name


def attach_child(
    document: Document, above: dict[str, str], joint: XmlElement, ends: tuple[str, str]
) -> None:
    """Record a joint's parent and child in `above`, unless the child has a parent already.

    Args:
        document: the file.
        above: parents by their children.
        joint: its element.
        ends: names of its parent and child; an empty child is ignored.
    """
    parent, child = ends
    if child in above:
        document.add_problem(
            joint,
            f"link {quote(child)} has a second parent, by joint {quote(joint.get('name'))}",
            "closed loops are not supported: remove the joint",
        )
    elif child:
        above[child] = parent


def add_loop_problems(
    document: Document, above: Mapping[str, str], links: Mapping[str, XmlElement]
) -> None:
    """Note each loop of links, at one of them."""
    for name in _looped(links, above):
        document.add_problem(
            links[name],
            f"link {quote(name)} is its own ancestor through its joints",
            "closed loops are not supported: remove a joint",
        )


def _looped(names: Iterable[str], above: Mapping[str, str]) -> Iterator[str]:
    """Yield one link of every loop."""
    passed: set[str] = set()
    for name in names:
        way: set[str] = set()
        while name in above and name not in passed:
            passed.add(name)
            way.add(name)
            name = above[name]
        if name in way:
            yield name

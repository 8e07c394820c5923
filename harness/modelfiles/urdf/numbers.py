"""The numbers of a URDF, and the tree for other values.

A changed number is read again with its link or its joint; the rest stays as it was read.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.documents.tree import GRAVITY
from physics_crosscheck.harness.documents.urdf import (
    UrdfFile,
    read_joint,
    read_link,
    read_mimics,
    read_springs,
    read_urdf,
)
from physics_crosscheck.reference.mechanism.assemble import assembled, with_bodies
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.tree import Tree
from ..build_tree import couplings, enforceable
from ..link_shapes import placed_in
from ..numbers import NUDGE, ModelFile, set_temporarily
from ..robot import PlacedShape
from .read import bodies_of, body_of, singles

_RELEVANT = re.compile(
    r"robot/(link/inertial/.*|joint/(origin|axis)@.*|joint/dynamics@damping|joint/mimic@.*"
    r"|gazebo/spring(Stiffness|Reference))"
)
"""Numbers that affect a tree."""

_BODIES = re.compile(r"robot/(link/inertial/.*|joint/(origin|axis)@.*|joint/dynamics@damping)")
"""Numbers that affect one body of it and its joint."""

_SHAPES = re.compile(
    r"robot/link/collision/(origin@(xyz|rpy)|geometry/(box|sphere|cylinder|capsule|mesh)@\w+)"
)
"""Numbers on which collision shapes depend."""


class UrdfNumbers(ModelFile):
    """The numbers of a URDF that has a tree.

    Args:
        path: of the file.
        floating: whether its root moves freely.
        held: joints that are fixed.
        armatures: as in `Document`.

    Attributes:
        floats: whether its root moves freely.
    """

    def __init__(
        self,
        path: Path,
        *,
        floating: bool,
        held: Collection[str] = (),
        armatures: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._document = Document(path)
        super().__init__([self._document])
        self._document.armatures = armatures
        self._file = file = read_urdf(self._document)
        self._held, self.floats = held, floating and file.can_float
        if has_stand_ins(path):
            self.numerals = tuple(one for one in self.numerals if "/inertial/" not in one.path)

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""
        owners = {one.element for one in self._file.links.values()}
        owners |= {one.element for one in self._file.joints.values()}
        owners |= set(self._document.root.findall("gazebo"))
        numbers = enumerate(self.numerals)
        kept = (i for i, one in numbers if _RELEVANT.fullmatch(one.path))
        return tuple(i for i in kept if self._owner(i) in owners)

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        nominal = self._nominal
        if nominal is None or not all(_BODIES.fullmatch(self.numerals[i].path) for i in values):
            return self._built(values)
        if not values:
            return nominal
        with self.changed(values, coupled=True, tree=nominal) as changed:
            if changed is None:
                return None
            file, joints = changed[0], {one.child: one for one in changed[0].joints.values()}
            others = {}
            for element in filter(None, map(self._owner, values)):
                name = element.get("name")
                link = file.joints[name].child if element.tag == "joint" else name
                if link in self._bodies:
                    joint = joints.get(link)
                    others[link] = body_of(file, link, joint, self.floats, self._held)
            return with_bodies(nominal, {**self._bodies, **others}, others)

    @cached_property
    def _nominal(self) -> Tree | None:
        """The tree of the file as it is."""
        return self._built({})

    @cached_property
    def _bodies(self) -> Mapping[str, RigidBody]:
        """The bodies of the file as it is, by their links."""
        return {body.name: body for body in bodies_of(self._file, self.floats, self._held)}

    def _built(self, values: Mapping[int, float]) -> Tree | None:
        with self.changed(values, coupled=True) as changed:
            return changed and changed[1]

    @contextmanager
    def changed(
        self, values: Mapping[int, float], *, coupled: bool, tree: Tree | None = None
    ) -> Iterator[tuple[UrdfFile, Tree] | None]:
        """Give the file with other values of some numbers, and its tree, or None.

        Its elements have these values until the context closes. A given tree is not built again.
        """
        document = self._document
        count = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                set_temporarily(self.numerals[index], value, restored)
            read = partial(self._reread, values, coupled=coupled, tree=tree)
            changed = read() if self._file.root else None
            yield None if len(document.obstacles) > count else changed
        del document.obstacles[count:]

    def _reread(
        self, values: Mapping[int, float], *, coupled: bool, tree: Tree | None
    ) -> tuple[UrdfFile, Tree] | None:
        """Return the file with the present values of some numbers, and its tree."""
        document = self._document
        elements = {id(owner): owner for i in values if (owner := self._owner(i)) is not None}
        links, joints = dict(self._file.links), dict(self._file.joints)
        for element in elements.values():
            name = element.get("name")
            if element.tag == "link":
                links[name] = read_link(document, element, name)
            elif element.tag == "joint":
                joints[name] = read_joint(document, element, name)
        file = replace(self._file, links=links, joints=joints)
        if tree is not None:
            return file, tree
        springs, mimics = read_springs(document), read_mimics(document, joints)
        file = replace(file, springs=springs)
        leaders = enforceable(mimics, singles(joints) - set(self._held)) if coupled else {}
        bodies = bodies_of(file, self.floats, self._held)
        tree = assembled(bodies, GRAVITY, couplings=couplings(leaders)).tree
        return None if tree is None else (file, tree)

    def placing(self, candidates: Collection[int]) -> Collection[int]:
        """Return those on which the frame or the size of a collision shape depends."""
        shapes = (i for i in candidates if _SHAPES.fullmatch(self.numerals[i].path))
        return frozenset(i for i in shapes if self._places_shape(i))

    def _places_shape(self, index: int) -> bool:
        number, owner = self.numerals[index], self._owner(index)
        links = {name: one for name, one in self._file.links.items() if one.element is owner}
        before = placed_in(links, self._document.path)
        with ExitStack() as restored:
            set_temporarily(number, number.value + NUDGE * number.scale, restored)
            return any(map(_differ, before, placed_in(links, self._document.path)))

    def _owner(self, index: int) -> XmlElement | None:
        return _owner(self.numerals[index].element)


def _owner(element: XmlElement) -> XmlElement | None:
    """Return the child of the root that contains an element."""
    while element.parent is not None and element.parent.parent is not None:
        element = element.parent
    return None if element.parent is None else element


def _differ(first: PlacedShape, second: PlacedShape) -> bool:
    """Return whether two shapes differ in frame, size or scale."""
    same = map(np.array_equal, first.place, second.place)
    return (first.size, first.scale) != (second.size, second.scale) or not all(same)

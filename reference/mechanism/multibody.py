"""Declared trees of bodies, whose equations follow by recursion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from .assemble import Assembled, assembled
from .bodies import Coupling, ForceElement, RigidBody, Triple
from .chart import Coupled, coordinate_names
from .declaration import Coordinate, Declaration, DeclarationError
from .tree import Fluid, Tree, TreeError


@dataclass(frozen=True, kw_only=True)
class TreeSystem(Declaration):
    """A mechanism declared by bodies instead of energies; T, V and D are unused.

    Its coordinates are the independent joint coordinates (`reference.mechanism.chart`), in the
    tree's order.

    Raises:
        DeclarationError: if the coordinates do not match the tree.
    """

    tree: Tree

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.coordinates) != self.tree.dof:
            raise DeclarationError(
                f"system {self.name!r} has {len(self.coordinates)} coordinates, but "
                f"its tree has {self.tree.dof} degrees of freedom"
            )


def tree_system(*, name: str, title: str, source: str, tree: Tree) -> TreeSystem:
    """Return a tree as a system with the independent joint coordinates."""
    rows = [row for link in tree.links for row in coordinate_names(link.kind, link.name)]
    return TreeSystem(
        name=name,
        title=title,
        source=source,
        coordinates=tuple(
            Coordinate(row, unit, f"joint {row.partition(':')[0]}")
            for row, unit in (rows[i] for i in Coupled(tree).kept)
        ),
        constants=(),
        inputs=(),
        outputs=(),
        T=0,
        V=0,
        D=0,
        equilibria=(),
        scenarios=(),
        published=(),
        tree=tree,
    )


@dataclass(frozen=True, kw_only=True)
class MultibodySystem:
    """A mechanism of bodies, joints and force elements, with a model's numbers in SI units.

    Attributes:
        name: name of the system.
        title: a few words about it.
        source: source of the numbers.
        gravity: m/s^2.
        bodies: parents before children.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        fluid: fluid around the bodies; None for none.

    Raises:
        DeclarationError: with the body, joint or force element that does not fit.
    """

    name: str
    title: str
    source: str
    gravity: Triple
    bodies: tuple[RigidBody, ...]
    pulls: tuple[ForceElement, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    fluid: Fluid | None = None

    def __post_init__(self) -> None:
        try:
            assembly = self.assembled
            Coupled(assembly.tree)  # raises if joints follow each other in a cycle
        except TreeError as error:
            raise DeclarationError(str(error)) from None
        if not assembly.tree.links:
            raise DeclarationError(f"system {self.name!r} has no joint, so nothing moves")
        for name in assembly.cancelled:
            raise DeclarationError(
                f"the masses of body {name!r} and of the bodies fixed to it do not "
                "add up to a positive mass; write positive masses"
            )

    @cached_property
    def assembled(self) -> Assembled:
        """The tree, and the location of each body in it."""
        return assembled(self.bodies, self.gravity, self.pulls, self.couplings, self.fluid)

    @cached_property
    def tree_system(self) -> TreeSystem:
        """The tree as a system of equations."""
        tree = self.assembled.tree
        return tree_system(name=self.name, title=self.title, source=self.source, tree=tree)

"""Read an MJCF as a mechanism: an engine compiles it, the file's text gives the places of numbers.

A compiled number that is stated in the file is bound to its place there. A computed number (the
inertia of a shape, for example) is a constant without a place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.commands.scaffold.constants import Ledger
from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.commands.scaffold.mechanism import (
    FormulaBody,
    FormulaJoint,
    Mechanism,
    Triple,
    Turn,
)
from physics_crosscheck.harness.documents.elements import XmlElement, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import SourceFile
from physics_crosscheck.harness.engines.compiled import CompiledBody, CompiledJoint
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.engines.registry import engines_reading

_FOREIGN = {
    "include": "parts in other files",
    "replicate": "bodies made by repetition",
    "composite": "bodies made by repetition",
    "flexcomp": "flexible bodies",
    "flex": "flexible bodies",
    "attach": "models put into models",
    "plugin": "plugins",
    "freejoint": "free joints",
    "equality": "equalities",
    "tendon": "tendons",
    "actuator": "actuators; crosscheck applies inputs to joints, so remove them",
}
_MASSLESS = {"mesh": "the inertia of meshes", "hfield": "height fields", "sdf": "shapes of plugins"}
_DIGITS = 1e-15


def read_mjcf(path: Path, data: bytes, ledger: Ledger) -> Mechanism:
    """Read bodies and joints; each number becomes a constant, bound to its place if it has one.

    Raises:
        NewError: naming file, line and the unreadable part.
    """
    able = [engine for engine in engines_reading(path.suffix) if path.suffix in engine.compiles]
    there = [engine for engine in able if engine.version() is not None]
    if not there:
        titles = " or ".join(engine.title for engine in able)
        raise NewError(f"{path}: reading an MJCF needs {titles}, which is not installed")
    return _MjcfReader(path, data, ledger, there[0]).mechanism()


class _MjcfReader:
    def __init__(self, path: Path, data: bytes, ledger: Ledger, engine: Engine) -> None:
        self.source, self.ledger, self.path = SourceFile(path, data), ledger, path
        self.title = engine.title
        try:
            self.elements = read_elements(self.source)
        except LocationError as error:
            raise NewError(str(error)) from None
        self._refuse_foreign()
        try:
            self.tree = engine.compiled(path)
        except EngineError as error:
            raise NewError(str(error)) from None
        world = [e for e in self.elements if e.tag == "worldbody"]
        self.bodies = [e for top in world for e in _below(top, "body")]
        self.joints = [e for body in self.bodies for e in _children(body, "joint")]
        self.remarks: list[str] = []
        count = sum(len(body.joints) for body in self.tree.bodies)
        if len(self.bodies) != len(self.tree.bodies) or len(self.joints) != count:
            raise NewError(
                f"{path}: {self.title} builds other bodies or joints than the file contains"
            )

    def refuse(self, element: XmlElement, sentence: str) -> NewError:
        return NewError(f"{self.path}:{self.source.line(element.start)}: {sentence}")

    def _refuse_foreign(self) -> None:
        for element in self.elements:
            if element.tag in _FOREIGN and (element.children or element.attributes):
                raise self.refuse(
                    element, f"<{element.tag}>: {_FOREIGN[element.tag]} are not supported"
                )

    def mechanism(self) -> Mechanism:
        g = self.tree.gravity
        if self.tree.fluid:
            raise NewError(f"{self.path}: a medium (wind, density or viscosity) can't be read")
        gravity = [
            self.ledger.number(
                float(value),
                ("g",) if np.count_nonzero(g) == 1 else (f"g_{axis}",),
                "m/s^2",
                "gravity",
                f"option@gravity[{i}]",
            )
            for i, (axis, value) in enumerate(zip("xyz", g, strict=True))
        ]
        frames = {0: "ground"}
        bodies = []
        for i, (body, element) in enumerate(
            zip(self.tree.bodies, self.bodies, strict=True), start=1
        ):
            if not body.ordinary:
                raise self.refuse(element, "mocap bodies and gravity compensation can't be read")
            bodies.append(self._body(i, body, element, frames))
        return Mechanism(tuple(bodies), (gravity[0], gravity[1], gravity[2]), tuple(self.remarks))

    def _body(
        self, i: int, body: CompiledBody, element: XmlElement, frames: dict[int, str]
    ) -> FormulaBody:
        name = element.attributes.get("name") or f"body_{i}"
        address = self._address(element)
        position = self._triple(
            body.position,
            (name,),
            "m",
            f"{name} in its parent's frame",
            address and f"{address}@pos",
        )
        turns = self._turns(body.turn, element, address, name)
        first = sum(len(before.joints) for before in self.tree.bodies[: i - 1])
        joints = tuple(
            self._joint(joint, self.joints[first + j]) for j, joint in enumerate(body.joints)
        )
        frames[i] = self.ledger.name(name, "frame")
        mass, centre, principal, moments, products = self._inertial(body, element, address, name)
        return FormulaBody(
            name=name,
            symbol=frames[i],
            parent=frames[body.parent],
            position=position,
            turns=turns,
            joints=joints,
            mass=mass,
            centre=centre,
            principal=principal,
            moments=moments,
            products=products,
            place=f"body:{name}" if element.attributes.get("name") else "",
        )

    def _inertial(
        self, body: CompiledBody, element: XmlElement, address: str | None, name: str
    ) -> tuple[str, Triple, tuple[Turn, ...], Triple, Triple]:
        none: Triple = ("0", "0", "0")
        inertial = _children(element, "inertial")
        if not inertial and body.mass:
            for geom in _children(element, "geom"):
                kind = "mesh" if "mesh" in geom.attributes else geom.attributes.get("type", "")
                if kind in _MASSLESS and geom.attributes.get("mass") != "0":
                    raise self.refuse(
                        geom, f"{_MASSLESS[kind]} can't be read; give body {name!r} an <inertial>"
                    )
            self.remarks.append(
                f"body {name!r} has no <inertial>: {self.title} computes its mass "
                "and inertia from geoms, so they have no line in the file"
            )
        within = f"{address}/inertial" if inertial and address else None
        mass = self.ledger.number(
            body.mass,
            (name, "mass"),
            "kg",
            f"mass of {name}",
            within and f"{within}@mass",
        )
        centre = self._triple(
            body.centre,
            (name, "centre"),
            "m",
            f"centre of mass of {name}",
            within and f"{within}@pos",
        )
        full = inertial[0].attributes.get("fullinertia", "").split() if inertial else []
        if full:
            # The engine diagonalizes these; the file states them in body axes.
            six = [
                self.ledger.number(
                    float(value),
                    (name, f"i{axes}"),
                    "kg*m^2",
                    f"I{axes} of {name} about its centre",
                    within and f"{within}@fullinertia[{k}]",
                )
                for k, (axes, value) in enumerate(
                    zip(("xx", "yy", "zz", "xy", "xz", "yz"), full, strict=True)
                )
            ]
            return mass, centre, (), (six[0], six[1], six[2]), (six[3], six[4], six[5])
        moments = tuple(
            self.ledger.number(
                float(value),
                (name, f"i{axis}{axis}"),
                "kg*m^2",
                f"I{axis}{axis} of {name} about its centre",
                within and f"{within}@diaginertia[{k}]",
            )
            for k, (axis, value) in enumerate(zip("xyz", body.moments, strict=True))
        )
        inner = self._turns(
            body.principal, inertial[0] if inertial else None, within, f"{name}_inertia"
        )
        return mass, centre, inner, (moments[0], moments[1], moments[2]), none

    def _joint(self, joint: CompiledJoint, element: XmlElement) -> FormulaJoint:
        name = joint.name
        if joint.kind not in ("hinge", "slide"):
            raise self.refuse(
                element,
                f"joint {name!r} is a {joint.kind} joint; only slides and hinges are supported",
            )
        if not name:
            raise self.refuse(
                element, "this joint has no name; name it, because its coordinate needs a name"
            )
        hinge = joint.kind == "hinge"
        if joint.friction:
            raise self.refuse(
                element,
                f"joint {name!r} has frictionloss, which is not smooth, so its "
                "motion is not compared",
            )
        unit, force = ("rad", "N*m") if hinge else ("m", "N")
        inertia = "kg*m^2" if hinge else "kg"
        damping = self._first(joint.damping, element, "damping")
        stiffness = self._first(joint.stiffness, element, "stiffness")
        symbol = self.ledger.name(name)
        number = self._of_joint(element, name)
        x, y, z = joint.axis
        return FormulaJoint(
            name=name,
            symbol=symbol,
            hinge=hinge,
            axis=(x, y, z),
            position=self._triple(
                joint.position,
                (name,),
                "m",
                f"axis of {name} in its body",
                self._attribute(element, "pos"),
            ),
            zero=number(joint.zero, "ref", unit, hinge),
            damping=number(damping, "damping", f"{force}*s/{unit}", False),
            stiffness=number(stiffness, "stiffness", f"{force}/{unit}", False),
            rest=number(joint.rest, "springref", unit, hinge) if stiffness else "0",
            armature=number(joint.armature, "armature", inertia, False),
            limits=joint.limits,
            where=f"{self.path.name}:{self.source.line(element.start)}",
        )

    def _first(self, coefficients: Sequence[float], element: XmlElement, what: str) -> float:
        """Return a stiffness or damping; reject higher terms of polynomials."""
        if any(coefficients[1:]):
            raise self.refuse(element, f"its {what} is a polynomial; only the first term is used")
        return coefficients[0]

    def _of_joint(self, element: XmlElement, name: str) -> Callable[[float, str, str, bool], str]:
        degrees = not self._radians()

        def number(value: float, key: str, unit: str, angle: bool) -> str:
            return self.ledger.number(
                value,
                (name, key),
                unit,
                f"{key} of {name}",
                self._attribute(element, key),
                angle and degrees,
            )

        return number

    def _radians(self) -> bool:
        return any(
            e.tag == "compiler" and e.attributes.get("angle") == "radian" for e in self.elements
        )

    def _attribute(self, element: XmlElement, key: str) -> str | None:
        """Return the place of an attribute: in the element, or in the defaults of its class."""
        address = self._address(element)
        if key in element.attributes:
            return address and f"{address}@{key}"
        holder: XmlElement | None = element
        wanted = element.attributes.get("class")
        while wanted is None and holder is not None:
            wanted, holder = holder.attributes.get("childclass"), holder.parent
        defaults = [e for e in self.elements if e.tag == "default"]
        element_above = next(
            (e for e in defaults if e.attributes.get("class", "main") == (wanted or "main")), None
        )
        while element_above is not None and element_above.tag == "default":
            for child in _children(element_above, element.tag):
                if key in child.attributes:
                    return self._address(child) and f"{self._address(child)}@{key}"
            element_above = element_above.parent
        return None

    def _address(self, element: XmlElement) -> str | None:
        """Return the shortest path that matches this element only."""
        alike = [e for e in self.elements if e.tag == element.tag]
        levels: dict[int, XmlElement | None] = {id(e): e for e in alike}
        ancestor: XmlElement | None = element
        for depth in range(1, element.depth + 1):
            assert ancestor is not None
            # A step without a name matches every element of its tag.
            alike = [
                e
                for e in alike
                if (here := levels[id(e)]) is not None
                and here.tag == ancestor.tag
                and ancestor.identity in (None, here.identity)
            ]
            if len(alike) == 1:
                return element.spelled(depth)
            levels = {id(e): here.parent for e in alike if (here := levels[id(e)]) is not None}
            ancestor = ancestor.parent
        return None

    def _triple(
        self,
        values: Sequence[float],
        name: tuple[str, ...],
        unit: str,
        what: str,
        address: str | None,
    ) -> Triple:
        x, y, z = (
            self.ledger.number(
                float(value),
                (*name, axis),
                unit,
                f"{axis} of {what}" if unit == "m" else what,
                address and f"{address}[{i}]",
            )
            for i, (axis, value) in enumerate(zip("xyz", values, strict=True))
        )
        return x, y, z

    def _turns(
        self,
        quaternion: Sequence[float],
        element: XmlElement | None,
        address: str | None,
        name: str,
    ) -> tuple[Turn, ...]:
        """Return one rotation about one axis; bind its angle if the file states it directly."""
        w, vector = float(quaternion[0]), np.array(quaternion[1:], dtype=float)
        sine = float(np.linalg.norm(vector))
        if sine < _DIGITS:
            return ()
        angle, axis = 2 * float(np.arctan2(sine, w)), vector / sine
        place = None
        if element is not None and address and "euler" in element.attributes:
            euler = [float(x) for x in element.attributes["euler"].split()]
            if np.count_nonzero(euler) == 1 and not self._has("eulerseq"):
                k = int(np.flatnonzero(euler)[0])
                axis, place = np.eye(3)[k], f"{address}@euler[{k}]"
                angle = euler[k] if self._radians() else float(np.radians(euler[k]))
        if element is not None and address and "axisangle" in element.attributes:
            *given, angle = (float(x) for x in element.attributes["axisangle"].split())
            axis, place = np.array(given), f"{address}@axisangle[3]"
            angle = angle if self._radians() else float(np.radians(angle))
        x, y, z = (0.0 if abs(a) < _DIGITS else float(a) for a in axis)
        text = self.ledger.number(
            angle, (name, "turn"), "rad", f"turn of {name}", place, not self._radians()
        )
        return (Turn((x, y, z), text),)

    def _has(self, key: str) -> bool:
        return any(key in e.attributes for e in self.elements if e.tag == "compiler")


def _children(element: XmlElement, tag: str) -> list[XmlElement]:
    """Return the children of a tag; a <frame> only groups elements."""
    children = []
    for child in element.children:
        if child.tag == tag:
            children.append(child)
        elif child.tag == "frame":
            children += _children(child, tag)
    return children


def _below(element: XmlElement, tag: str) -> list[XmlElement]:
    """Return the elements of a tag at any depth, in the order of the file."""
    elements = []
    for child in element.children:
        if child.tag == tag:
            elements.append(child)
        elements += _below(child, tag)
    return elements

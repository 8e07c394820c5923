"""Read a URDF as a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from physics_crosscheck.harness.commands.scaffold.constants import Ledger, finite, quarter
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
from physics_crosscheck.harness.engines.registry import engines_reading

_AXES: tuple[tuple[float, float, float], ...] = ((0, 0, 1), (0, 1, 0), (1, 0, 0))
_ZERO: Triple = ("0", "0", "0")


def read_urdf(path: Path, data: bytes, ledger: Ledger) -> Mechanism:
    """Read links and joints; each number becomes a constant with its place.

    Raises:
        NewError: naming file, line and the unreadable part.
    """
    return _UrdfReader(path, data, ledger).mechanism()


class _UrdfReader:
    def __init__(self, path: Path, data: bytes, ledger: Ledger) -> None:
        self.source, self.ledger = SourceFile(path, data), ledger
        try:
            elements = read_elements(self.source)
        except LocationError as error:
            raise NewError(str(error)) from None
        if not elements or elements[0].tag != "robot":
            raise NewError(f"{path}:1: the root is not <robot>: not a URDF")
        self.top = elements[0].children
        self.remarks: list[str] = []

    def refuse(self, element: XmlElement, sentence: str) -> NewError:
        return NewError(f"{self.source.file}:{self.source.line(element.start)}: {sentence}")

    def mechanism(self) -> Mechanism:
        links = self._named("link")
        above = self._above(links)
        roots = [name for name in links if name not in above]
        if len(roots) != 1:
            raise NewError(
                f"{self.source.file}: it has {len(roots)} links without a parent; expected one"
            )
        frames = {roots[0]: "ground"}
        bodies: list[FormulaBody] = []
        queue = [roots[0]]
        while queue:
            parent = queue.pop(0)
            for link, joint in above.items():
                if _child_link(joint, "parent") == parent:
                    bodies.append(self._body(links[link], joint, frames))
                    queue.append(link)
        if len(bodies) < len(above):
            raise NewError(
                f"{self.source.file}: some links are their own ancestors and not "
                f"connected to {roots[0]!r}"
            )
        return Mechanism(tuple(bodies), _ZERO, tuple(self.remarks))

    def _above(self, links: Mapping[str, XmlElement]) -> dict[str, XmlElement]:
        """Return each link's parent joint, by the link's name."""
        above: dict[str, XmlElement] = {}
        for joint in self._named("joint").values():
            for end in ("parent", "child"):
                element = _child(joint, end)
                link = "" if element is None else element.attributes.get("link", "")
                if link not in links:
                    raise self.refuse(joint, f"its <{end}> is {link!r}, which is not a link")
                if end == "child":
                    if link in above:
                        raise self.refuse(
                            joint, f"link {link!r} has two parents; closed loops are not supported"
                        )
                    above[link] = joint
        return above

    def _named(self, tag: str) -> dict[str, XmlElement]:
        parents: dict[str, XmlElement] = {}
        for element in self.top:
            if element.tag != tag:
                continue
            name = element.attributes.get("name", "")
            if not name or name in parents:
                raise self.refuse(element, f"this <{tag}> needs a unique name")
            parents[name] = element
        return parents

    def _body(self, link: XmlElement, joint: XmlElement, frames: dict[str, str]) -> FormulaBody:
        name, joint_name = link.attributes["name"], joint.attributes["name"]
        position, turns = self._origin(joint, f"joint[{joint_name}]", name)
        moving = self._joint(joint)
        mass, centre, moments, products = "0", _ZERO, _ZERO, _ZERO
        principal: tuple[Turn, ...] = ()
        inertial = _child(link, "inertial")
        if inertial is None:
            if moving is not None:
                raise self.refuse(
                    link,
                    f"link {name!r} moves and has no <inertial>, and engines differ "
                    "in their default: write one",
                )
            others = [
                f"; {e.title} uses {e.massless_link_default}"
                for e in engines_reading(".urdf")
                if e.massless_link_default
            ]
            self.remarks.append(
                f"link {name!r} has no <inertial>, so it has no mass here{''.join(others)}"
            )
        else:
            within = f"link[{name}]/inertial"
            centre, principal = self._origin(inertial, within, f"{name}_centre")
            element = self._wanted(inertial, "mass")
            mass = self._number(
                element, "value", f"{within}/mass", (name, "mass"), "kg", f"mass of {name}"
            )
            element = self._wanted(inertial, "inertia")
            moments = self._tensor(element, ("ixx", "iyy", "izz"), within, name)
            products = self._tensor(element, ("ixy", "ixz", "iyz"), within, name)
        frames[name] = self.ledger.name(name, "frame")
        parent = frames[_child_link(joint, "parent")]
        return FormulaBody(
            name=name,
            symbol=frames[name],
            parent=parent,
            position=position,
            turns=turns,
            joints=() if moving is None else (moving,),
            mass=mass,
            centre=centre,
            principal=principal,
            moments=moments,
            products=products,
            place=f"link:{name}",
        )

    def _tensor(self, element: XmlElement, keys: Triple, within: str, name: str) -> Triple:
        ixx, two, three = (
            self._number(
                element,
                key,
                f"{within}/inertia",
                (name, key),
                "kg*m^2",
                f"{key} of {name} about its centre",
            )
            for key in keys
        )
        return ixx, two, three

    def _joint(self, joint: XmlElement) -> FormulaJoint | None:
        name, kind = joint.attributes["name"], joint.attributes.get("type", "")
        if kind == "fixed":
            return None
        if kind not in ("revolute", "continuous", "prismatic"):
            raise self.refuse(
                joint,
                f"joint {name!r} is of type {kind!r}; only slides and hinges are supported",
            )
        if _child(joint, "mimic") is not None:
            raise self.refuse(
                joint,
                f"joint {name!r} mimics another, which is not supported; start from "
                "`crosscheck new` and write its folder by hand",
            )
        hinge = kind != "prismatic"
        unit = "rad" if hinge else "m"
        force = "N*m" if hinge else "N"
        symbol = self.ledger.name(name)
        axis = self._axis(joint, name)
        damping = "0"
        dynamics = _child(joint, "dynamics")
        if dynamics is not None:
            if self._value(dynamics, "friction"):
                raise self.refuse(
                    dynamics,
                    f"joint {name!r} has friction, which is not smooth, so its "
                    "motion is not compared",
                )
            damping = self._number(
                dynamics,
                "damping",
                f"joint[{name}]/dynamics",
                (name, "damping"),
                f"{force}*s/{unit}",
                f"viscous friction of {name}",
            )
        stiffness = rest = "0"
        for gazebo in self.top:
            if gazebo.tag == "gazebo" and gazebo.attributes.get("reference") == name:
                stiffness = self._text(
                    gazebo, "springStiffness", name, "stiffness", f"{force}/{unit}"
                )
                rest = self._text(gazebo, "springReference", name, "rest", unit)
        return FormulaJoint(
            name=name,
            symbol=symbol,
            hinge=hinge,
            axis=axis,
            position=_ZERO,
            zero="0",
            damping=damping,
            stiffness=stiffness,
            rest=rest,
            armature="0",
            limits=self._limits(joint, kind, name),
            where=f"{self.source.file.name}:{self._line(joint)}",
        )

    def _line(self, element: XmlElement) -> int:
        return self.source.line(element.start)

    def _axis(self, joint: XmlElement, name: str) -> tuple[float, float, float]:
        element = _child(joint, "axis")
        if element is None:
            return (1.0, 0.0, 0.0)
        x, y, z = self._three(element, "xyz", "1 0 0")
        if not (x or y or z):
            raise self.refuse(element, f"the axis of joint {name!r} has no length")
        return x, y, z

    def _limits(self, joint: XmlElement, kind: str, name: str) -> tuple[float, float] | None:
        if kind == "continuous":
            return None
        limit = _child(joint, "limit")
        if limit is None or "lower" not in limit.attributes or "upper" not in limit.attributes:
            raise self.refuse(
                joint,
                f"joint {name!r} has no lower and upper limits, so engines hold it "
                "at 0: set them, or make it continuous",
            )
        return self._value(limit, "lower"), self._value(limit, "upper")

    def _origin(
        self, element: XmlElement, within: str, name: str
    ) -> tuple[Triple, tuple[Turn, ...]]:
        origin = _child(element, "origin")
        if origin is None:
            return _ZERO, ()
        place = self._three(origin, "xyz", "0 0 0")
        position = tuple(
            self.ledger.number(
                value,
                (name, axis),
                "m",
                f"{axis} of {name} in its parent's frame"
                if "inertial" not in within
                else f"{axis} of the centre of mass",
                f"{within}/origin@xyz[{i}]",
            )
            for i, (axis, value) in enumerate(zip("xyz", place, strict=True))
        )
        roll_pitch_yaw = self._three(origin, "rpy", "0 0 0")
        turns = []
        if sum(angle != 0 and quarter(angle) is None for angle in roll_pitch_yaw) > 1:
            # As symbols, several angles at a place give formulas of many thousand terms.
            self.remarks.append(
                f"the rotation of {name} is kept as numbers: a wrong one makes the "
                "case differ, but has no named cause"
            )
            turns = [
                Turn(axis, repr(roll_pitch_yaw[i]))
                for i, axis in ((2, _AXES[0]), (1, _AXES[1]), (0, _AXES[2]))
                if roll_pitch_yaw[i]
            ]
            return (position[0], position[1], position[2]), tuple(turns)
        for i, axis, what in ((2, _AXES[0], "yaw"), (1, _AXES[1], "pitch"), (0, _AXES[2], "roll")):
            angle = self.ledger.number(
                roll_pitch_yaw[i],
                (name, what),
                "rad",
                f"{what} of {name}",
                f"{within}/origin@rpy[{i}]",
            )
            if angle != "0":
                turns.append(Turn(axis, angle))
        return (position[0], position[1], position[2]), tuple(turns)

    def _wanted(self, inertial: XmlElement, tag: str) -> XmlElement:
        element = _child(inertial, tag)
        if element is None:
            raise self.refuse(inertial, f"this <inertial> has no <{tag}>")
        return element

    def _number(
        self,
        element: XmlElement,
        key: str,
        within: str,
        name: tuple[str, ...],
        unit: str,
        what: str,
    ) -> str:
        return self.ledger.number(self._value(element, key), name, unit, what, f"{within}@{key}")

    def _text(self, gazebo: XmlElement, tag: str, joint: str, what: str, unit: str) -> str:
        element = _child(gazebo, tag)
        if element is None:
            return "0"
        try:
            value = finite(element.text)
        except ValueError:
            raise self.refuse(element, f"{element.text!r} is not a number") from None
        return self.ledger.number(
            value, (joint, what), unit, f"spring of {joint}: {what}", f"gazebo[{joint}]/{tag}"
        )

    def _value(self, element: XmlElement, key: str) -> float:
        text = element.attributes.get(key, "0")
        try:
            return finite(text)
        except ValueError:
            raise self.refuse(element, f"{key} is {text!r}; expected a number") from None

    def _three(self, element: XmlElement, key: str, default: str) -> tuple[float, float, float]:
        text = element.attributes.get(key, default)
        try:
            x, y, z = map(finite, text.split())
        except ValueError:
            raise self.refuse(element, f"{key} is {text!r}; expected three numbers") from None
        return x, y, z


def _child(element: XmlElement, tag: str) -> XmlElement | None:
    return next((child for child in element.children if child.tag == tag), None)


def _child_link(joint: XmlElement, tag: str) -> str:
    element = _child(joint, tag)
    return "" if element is None else element.attributes.get("link", "")

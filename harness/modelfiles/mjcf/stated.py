"""Numbers of the laws of an MJCF, read from its text by the documented rules of the format.

The laws themselves take the numbers of an engine's compiler. This reader resolves classes of
defaults, shortcuts, units and automatic limits without that compiler, so that no misreading is
shared by the law and the engine. Source: MuJoCo's documentation, XML reference.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.mjcf_defaults import Chain, Defaults, StatedPlace, Values
from physics_crosscheck.harness.engines.mjcf_inertias import aligns
from physics_crosscheck.harness.engines.mjcf_source import (
    ORIENTATIONS,
    MjcfSource,
    read_source_mjcf,
)
from physics_crosscheck.reference.mechanism.bodies import ZERO, powers
from physics_crosscheck.reference.mechanism.laws import Softness, Surface
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Array,
    about_axis,
    cross,
    to_quaternion,
)
from ..law_attributes import attributes
from .stated_drives import (
    KINDS,
    PARAMETER_KEYS,
    PARAMETERS,
    SHORTCUT_KEYS,
    SHORTCUTS,
    WORDS,
    read_drive,
)

Key = tuple[str, int]
"""A table, and the index of the body, joint, tendon, shape, drive or equality in its file."""

REFERENCE, IMPEDANCE = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
"""Defaults of `solref` and `solimp`."""

FRICTION = 1.0, 0.005, 0.0001
"""Default of a shape's `friction`."""

MACROS = ("replicate", "composite", "flexcomp", "attach")
"""Elements in bodies that generate others."""

EQUALITIES = ("connect", "weld", "joint", "tendon")

JOINTS = ("joint", "freejoint")

WEIGHING = ("boundmass", "boundinertia", "balanceinertia", "settotalmass")
"""Attributes of `<compiler>` that change the masses of `<inertial>` elements."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StatedRow:
    """Numbers of one body, joint, tendon, shape, drive or equality.

    Attributes:
        element: of the file.
        subject: its kind and name.
        values: by attribute, as a compiler stores them: in radians, with defaults.
        places: the numbers of the file that they follow from.
    """

    element: XmlElement
    subject: str
    values: Mapping[str, Values]
    places: frozenset[StatedPlace]


_Row = tuple[Key, Chain, Mapping[str, Values]]


class StatedLaws:
    """The numbers of a file's laws.

    Args:
        path: of the file.

    Attributes:
        unread: what is not read, in words.

    Raises:
        EngineError: naming file and line.
    """

    def __init__(self, path: Path) -> None:
        self._source = read_source_mjcf(path)
        self._classes = Defaults(self._source)
        self._contents: dict[str, list[XmlElement]] = {
            kind: [] for kind in ("body", "joint", "geom", "site")
        }
        self._inherited: dict[XmlElement, str] = {}
        self._macros = set[str]()
        worlds = self._source.root.findall("worldbody")
        self._collect([(one, one.get("childclass")) for one in worlds])
        self.unread = tuple(self._unread())

    def _collect(self, bodies: Sequence[tuple[XmlElement, str]]) -> None:
        """Collect the content of one body, which may have several elements, then below."""
        flat = [row for body, inherited in bodies for row in _flat(body, inherited)]
        for element, inherited in flat:
            self._inherited[element] = inherited
            if element.tag in ("geom", "site", *JOINTS):
                self._contents["joint" if element.tag in JOINTS else element.tag].append(element)
            elif element.tag in MACROS:
                self._macros.add(element.tag)
        for element, inherited in flat:
            if element.tag == "body":
                self._contents["body"].append(element)
                self._collect([(element, element.get("childclass", inherited))])

    def _unread(self) -> Iterator[str]:
        yield from (f"content of <{tag}>" for tag in sorted(self._macros))
        if self.overrides:
            yield "contact parameters that options override"
        tags = dict.fromkeys(one.tag for one in self._rows("actuator") if not self._is_read(one))
        yield from (f"drives <{tag}>" for tag in tags)
        if any(one.tag == "spatial" for one in self._rows("tendon")):
            yield "lengths of tendons between sites"
        held = [any(one.tag in ("geom", "frame") for one in body) and not body.findall("inertial")
                for body in self._contents["body"]]  # fmt: skip
        if any(held) or not self._states_inertias:
            yield "masses and inertias that follow from shapes"
        if self._source.root.findall("asset/mesh") or self._source.root.findall("asset/hfield"):
            yield "contents of meshes and height fields"
        if any(not _is_in_body(one) for kind in self._contents.values() for one in kind):
            yield "places within <frame>"

    @cached_property
    def rows(self) -> Mapping[Key, StatedRow]:
        """All rows."""
        rows: dict[Key, StatedRow] = {}
        for key, chain, values in self._every():
            element = chain.elements[-1]
            subject = f"{element.tag} {element.get('name') or f'#{key[1]}'}"
            subject = "options" if key[0] == "option" else subject
            places = frozenset(_places(key[0], chain, values))
            rows[key] = StatedRow(element=element, subject=subject, values=values, places=places)
        return rows

    @property
    def root(self) -> XmlElement:
        """The root element, with the content of included files."""
        return self._source.root

    def elements(self, kind: str, index: int) -> Sequence[XmlElement]:
        """Return an element before the defaults that it overwrites; nothing for another one.

        Args:
            kind: as of `names`.
            index: in the compiler's order.
        """
        every = self._elements[kind]
        return self._chain(every[index]).elements[::-1] if index < len(every) else ()

    @property
    def overrides(self) -> bool:
        """True if options replace the numbers of all contacts."""
        return self._source.stated("option/flag", "override") == "enable"

    @property
    def fuses(self) -> bool:
        """True if bodies that stand still become part of others, which reorders shapes."""
        return self._source.stated("compiler", "fusestatic") == "true"

    def names(self, kind: str) -> tuple[str, ...]:
        """Return the names of all elements of a kind in the compiler's order; some are empty.

        Args:
            kind: "body", "joint", "geom", "site", "tendon", "drive", "equality" or "pair".
        """
        return tuple(one.get("name") for one in self._elements[kind])

    @property
    def pairs(self) -> tuple[frozenset[int], ...]:
        """Indices of the shapes of each pair; a compiler sorts pairs."""
        names = self.names("geom")
        keys = ("geom1", "geom2")
        return tuple(
            frozenset(names.index(one.get(key)) for key in keys if one.get(key) in names)
            for one in self._elements["pair"]
        )

    @cached_property
    def _elements(self) -> Mapping[str, Sequence[XmlElement]]:
        return {
            **self._contents,
            "tendon": self._rows("tendon"),
            "drive": self._rows("actuator"),
            "equality": [one for one in self._rows("equality") if self._is_active(one)],
            "pair": self._source.root.findall("contact/pair"),
        }

    def _rows(self, section: str) -> list[XmlElement]:
        return self._source.root.findall(f"{section}/*")

    def _is_active(self, equality: XmlElement) -> bool:
        """Return whether an equality acts at the beginning, and has a law."""
        if equality.tag not in EQUALITIES:
            return False
        return self._chain(equality, "equality").word("active", "true") == "true"

    def _chain(self, element: XmlElement, *tags: str) -> Chain:
        inherited = self._inherited.get(element, "")
        return self._classes.chain(element, inherited, tags or (element.tag,))

    @property
    def _automatic(self) -> bool:
        return self._source.stated("compiler", "autolimits", "true") == "true"

    def _every(self) -> Iterator[_Row]:
        off = self._source.disabled
        options = Chain((self._source.root, *self._source.root.findall("option")))
        yield ("option", 0), options, self._options(options)
        yield from self._frame_rows()
        yield from self._inertia_rows()
        yield from self._joint_rows()
        yield from self._tendon_rows()
        for i, element in enumerate(self._elements["equality"]):
            if not off("constraint", "equality"):
                chain = self._chain(element, "equality")
                yield ("equality", i), chain, _equality(chain)
        if not self.overrides:
            for i, element in enumerate(self._elements["geom"]):
                chain = self._chain(element)
                yield ("geom", i), chain, surface_values(_surface(chain))
            for i, element in enumerate(self._elements["pair"]):
                chain = self._chain(element)
                yield ("pair", i), chain, _pair(chain)
        yield from self._drive_rows()

    def _options(self, chain: Chain) -> Mapping[str, Values]:
        return {
            "timestep": (chain.number("timestep", 0.002),),
            "integrator": (chain.word("integrator", "Euler").lower(),),
            "cone": (chain.word("cone", "pyramidal"),),
            "impratio": (chain.number("impratio", 1.0),),
            "refsafe": (float(not self._source.disabled("refsafe")),),
            "gravity": ZERO
            if self._source.disabled("gravity")
            else chain.numbers("gravity", (0.0, 0.0, -9.81)),
        }

    def _frame_rows(self) -> Iterator[_Row]:
        """Yield places of bodies and shapes outside of <frame>, sizes, and scales of meshes."""
        for b, element in enumerate(self._elements["body"]):
            if _is_in_body(element) and not self._is_aligned(element):
                yield ("place of body", b), Chain([element]), self._frame(Chain([element]))
        for kind, size in (("geom", ZERO), ("site", (0.005, 0.005, 0.005))):
            for i, element in enumerate(self._elements[kind]):
                chain = self._chain(element)
                if _is_fitted(chain):
                    continue
                if _is_in_body(element) and not self._is_aligned(element.parent):
                    frame = _between(chain) if chain.states("fromto") else self._frame(chain)
                    yield (f"place of {kind}", i), chain, frame
                if sizes := _size(chain, size):
                    yield (f"size of {kind}", i), chain, {"size": sizes}
        yield from self._mesh_rows()

    def _mesh_rows(self) -> Iterator[_Row]:
        """Yield scales of meshes."""
        files = (mesh for mesh in self._source.root.findall("asset/mesh") if mesh.get("file"))
        meshes = {mesh.get("name") or Path(mesh.get("file")).stem: mesh for mesh in files}
        for g, element in enumerate(self._elements["geom"]):
            chain = self._chain(element)
            mesh = meshes.pop(chain.word("mesh"), None)
            scaled = Chain([]) if mesh is None or _is_fitted(chain) else self._chain(mesh)
            if scaled.elements and not (scaled.states("refpos") or scaled.states("refquat")):
                yield ("mesh of geom", g), scaled, {"scale": scaled.numbers("scale", (1, 1, 1))}

    def _is_aligned(self, body: XmlElement | None) -> bool:
        """Return whether a compiler aligns a free body with its principal axes of inertia."""
        if body is None:
            return False
        joints = (one for one in body if one.tag in JOINTS)
        return any(self._is_free(one) and aligns(self._source, body, one) for one in joints)

    def _is_free(self, joint: XmlElement) -> bool:
        return joint.tag == "freejoint" or self._chain(joint).word("type") == "free"

    def _frame(self, chain: Chain) -> dict[str, Values]:
        return {"pos": chain.numbers("pos", ZERO), "quat": orientation(chain, self._source)}

    def _inertia_rows(self) -> Iterator[_Row]:
        if not self._states_inertias:
            return
        for b, element in enumerate(self._elements["body"]):
            if self._is_aligned(element):
                continue
            for inertial in element.findall("inertial"):
                chain = Chain([inertial])
                values = {"mass": chain.numbers("mass", [0.0]), "pos": chain.numbers("pos", ZERO)}
                if chain.states("fullinertia"):
                    values["fullinertia"] = chain.numbers("fullinertia", (*ZERO, *ZERO))
                elif chain.states("diaginertia"):
                    values["diaginertia"] = chain.numbers("diaginertia", ZERO)
                    values["quat"] = orientation(chain, self._source)
                yield ("inertia of body", b), chain, values

    @property
    def _states_inertias(self) -> bool:
        changed = any(self._source.stating("compiler", key) is not None for key in WEIGHING)
        return not changed and self._source.stated("compiler", "inertiafromgeom") != "true"

    def _joint_rows(self) -> Iterator[_Row]:
        for j, element in enumerate(self._elements["joint"]):
            if element.tag == "freejoint":
                continue
            chain = self._chain(element)
            kind = chain.word("type", "hinge")
            unit = self._source.angle_unit if kind in ("hinge", "ball") else 1.0
            if kind != "free" and _is_in_body(element):
                yield ("place of joint", j), chain, {"pos": chain.numbers("pos", ZERO)}
            yield from self._resistances("joint", j, chain, unit)
            yield ("dynamics of joint", j), chain, self._joint_dynamics(chain, kind, unit, element)

    def _joint_dynamics(
        self, chain: Chain, kind: str, unit: float, element: XmlElement
    ) -> Mapping[str, Values]:
        """Return inertia, damping, spring and axis of a joint; without those that are computed."""
        values: dict[str, Values] = {"armature": (chain.number("armature", 0.0),)}
        off = self._source.disabled
        if not chain.states("springdamper"):
            values |= _coefficients(chain, spring=off("spring"), damper=off("damper"))
        if kind in ("hinge", "slide"):
            values["springref"] = (unit * chain.number("springref", 0.0),)
            values["ref"] = (unit * chain.number("ref", 0.0),)
            if _is_in_body(element):
                axis = np.array(chain.numbers("axis", (0.0, 0.0, 1.0)))
                values["axis"] = tuple((axis / np.linalg.norm(axis)).tolist())
        return values

    def _tendon_rows(self) -> Iterator[_Row]:
        for t, element in enumerate(self._elements["tendon"]):
            chain = self._chain(element, "tendon")
            yield from self._resistances("tendon", t, chain, 1.0)
            keys = ("stiffness", "damping", "armature")
            if any(any(chain.numbers(key, (0.0,))) for key in keys) and not element.find("geom"):
                off = self._source.disabled
                values = dict(_coefficients(chain, spring=off("spring"), damper=off("damper")))
                lengths = chain.numbers("springlength", (-1.0, -1.0))
                if lengths[0] >= 0:
                    values["springlength"] = lengths
                yield ("dynamics of tendon", t), chain, values
            if element.tag == "fixed":
                combination = self._combination(element)
                if combination is not None:
                    values = {"coef": _flat_pairs(combination)}
                    yield ("path of tendon", t), Chain([element]), values

    def _resistances(self, kind: str, index: int, chain: Chain, unit: float) -> Iterator[_Row]:
        """Yield the limit, the dry friction and the force range of a joint or tendon."""
        off, automatic = self._source.disabled, self._automatic
        limits = chain.limits("", automatic=automatic, scale=unit)
        if limits is not None and not off("constraint", "limit"):
            margin = (chain.number("margin", 0.0),)
            values: dict[str, Values] = {
                "range": limits,
                "margin": margin,
                **_softness(chain, "limit"),
            }
            yield (f"limit of {kind}", index), chain, values
        friction = chain.number("frictionloss", 0.0)
        if friction and not off("constraint", "frictionloss"):
            values = {"frictionloss": (friction,), **_softness(chain, "friction")}
            yield (f"friction of {kind}", index), chain, values
        forces = chain.limits("actuatorfrc", automatic=automatic)
        if forces is not None:
            values = {"actuatorfrcrange": forces}
            if kind == "joint":
                lifts = chain.word("actuatorgravcomp", "false") == "true"
                values["actuatorgravcomp"] = (float(lifts),)
            yield (f"force of {kind}", index), chain, values

    def _combination(self, tendon: XmlElement) -> dict[int, float] | None:
        """Return the coefficients of a tendon's joints, by index; None for an unknown joint."""
        names, result = self.names("joint"), dict[int, float]()
        for term in tendon.findall("joint"):
            if term.get("joint") not in names:
                return None
            joint = names.index(term.get("joint"))
            result[joint] = result.get(joint, 0.0) + Chain([term]).number("coef", 0.0)
        return result

    def _is_read(self, drive: XmlElement) -> bool:
        chain = self._drive_chain(drive)
        kinds = {one.get(key, "none") for one in chain.elements for key in WORDS}
        return kinds <= KINDS and all(one.tag in SHORTCUTS for one in chain.elements)

    def _drive_chain(self, element: XmlElement) -> Chain:
        tags = {*SHORTCUTS, *(one.tag for one in self._rows("actuator"))}
        return self._chain(element, *tags)

    def _drive_rows(self) -> Iterator[_Row]:
        for i, element in enumerate(self._elements["drive"]):
            if not self._is_read(element):
                continue
            chain = self._drive_chain(element)
            values = read_drive(chain, automatic=self._automatic, target=self._target(chain))
            if self._source.disabled("clampctrl"):
                values = {**values, "ctrlrange": ()}
            combination = self._driven(chain)
            if combination is not None:
                gear = chain.number("gear", 1.0)
                shares = {joint: gear * share for joint, share in combination.items()}
                values = {**values, "gear": _flat_pairs(shares)}
            yield ("drive", i), chain, values

    def _driven(self, chain: Chain) -> dict[int, float] | None:
        """Return the coefficients of the hinges and slides that a drive acts on, or None."""
        joint = self._named("joint", chain.word("joint", chain.word("jointinparent")))
        if joint is not None:
            kind = "free" if joint.tag == "freejoint" else self._chain(joint).word("type", "hinge")
            index = list(self._elements["joint"]).index(joint)
            return {index: 1.0} if kind in ("hinge", "slide") else None
        tendon = self._named("tendon", chain.word("tendon"))
        return self._combination(tendon) if tendon is not None and tendon.tag == "fixed" else None

    def _target(self, chain: Chain) -> tuple[float, float] | None:
        """Return the range of the joint or tendon that a drive acts on; None without one."""
        for kind in ("joint", "tendon"):
            target = self._named(kind, chain.word(kind))
            if target is not None:
                limited = self._chain(target, kind)
                turns = kind == "joint" and limited.word("type", "hinge") in ("hinge", "ball")
                unit = self._source.angle_unit if turns else 1.0
                return limited.limits("", automatic=self._automatic, scale=unit)
        return None

    def _named(self, kind: str, name: str) -> XmlElement | None:
        return next((one for one in self._elements[kind] if name and one.get("name") == name), None)


def _places(table: str, chain: Chain, values: Mapping[str, Values]) -> Iterator[StatedPlace]:
    """Yield the numbers of a file that the values of a row follow from."""
    if table == "path of tendon":
        for term in chain.elements[-1].findall("joint"):
            yield from Chain([term]).effective(["coef"])
        return
    used = {key: len(values[key]) for key in PARAMETER_KEYS if key in values}
    used |= {"gear": 1}
    if "size" in values:
        used["size"] = 1 if chain.states("fromto") else len(values["size"])
    keys = (*values, *SHORTCUT_KEYS) if table == "drive" else tuple(values)
    keys = (*keys, *ORIENTATIONS) if "quat" in values else keys
    keys = (*keys, "fromto") if chain.states("fromto") else keys
    for element, key, word in chain.effective(dict.fromkeys(keys)):
        if word < used.get(key, PARAMETERS):
            yield element, key, word


SIZES: Mapping[str, int] = MappingProxyType({
    "plane": 3, "sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3,
})  # fmt: skip
"""Numbers that give the size of a shape, by its type."""


def _is_fitted(chain: Chain) -> bool:
    """Return whether a shape is a primitive that is fitted to a mesh."""
    return chain.states("mesh") and chain.word("type") not in ("mesh", "sdf")


def _size(chain: Chain, default: Sequence[float]) -> Values:
    """Return the size of a primitive; its length is that between two points, if they are stated."""
    kind = chain.word("type", "sphere")
    count, size = SIZES.get(kind, 0), list(chain.numbers("size", default))
    if chain.states("fromto"):
        ends = np.array(chain.numbers("fromto", (0.0,) * 6))
        half = float(np.linalg.norm(ends[:3] - ends[3:])) / 2
        size = [size[0], half] if count == 2 else [size[0], size[0], half]
    return tuple(size[:count])


def _between(chain: Chain) -> dict[str, Values]:
    """Return the frame of an element between two points: its z axis points to the first one."""
    ends = np.array(chain.numbers("fromto", (0.0,) * 6))
    middle = (ends[:3] + ends[3:]) / 2
    return {"pos": tuple(middle.tolist()), "quat": to_quaternion(to_axis(ends[:3] - ends[3:]))}


def _coefficients(chain: Chain, *, spring: bool, damper: bool) -> Mapping[str, Values]:
    """Return stiffness and damping without the zeros at their ends; nothing if switched off."""
    return {
        key: () if off else powers(chain.numbers(key, (0.0,) * POWERS))
        for key, off in (("stiffness", spring), ("damping", damper))
    }


POWERS = 3
"""Most coefficients of a stiffness or damping."""


def _is_in_body(element: XmlElement) -> bool:
    """Return whether an element is in a body itself, not in a frame there."""
    return element.parent is not None and element.parent.tag in ("body", "worldbody")


def _flat(parent: XmlElement, inherited: str) -> Iterator[tuple[XmlElement, str]]:
    """Yield the content of a body and of its frames, each with its inherited class."""
    for element in parent:
        yield element, inherited
        if element.tag == "frame":
            yield from _flat(element, element.get("childclass", inherited))


def _flat_pairs(combination: Mapping[int, float]) -> Values:
    """Return indices and coefficients, by index."""
    return tuple(value for pair in sorted(combination.items()) for value in pair)


def _softness(chain: Chain, suffix: str = "") -> Mapping[str, Values]:
    return {
        f"solref{suffix}": chain.numbers(f"solref{suffix}", REFERENCE),
        f"solimp{suffix}": chain.numbers(f"solimp{suffix}", IMPEDANCE),
    }


def _equality(chain: Chain) -> Mapping[str, Values]:
    values, kind = dict(_softness(chain)), chain.elements[-1].tag
    if kind in ("joint", "tendon"):
        values["polycoef"] = chain.numbers("polycoef", (0.0, 1.0, 0.0, 0.0, 0.0))
    if chain.states("anchor") or (kind == "weld" and not chain.states("site1")):
        values["anchor"] = chain.numbers("anchor", (0.0, 0.0, 0.0))
    if kind == "weld":
        values["torquescale"] = (chain.number("torquescale", 1.0),)
    return values


def _surface(chain: Chain) -> Surface:
    reference, impedance = _softness(chain).values()
    sliding, spinning, rolling = chain.numbers("friction", FRICTION)
    first, second = (_plain(reference)[0], _plain(reference)[1])
    return Surface(
        body=0,
        dimension=int(chain.number("condim", 3)),
        friction=(sliding, spinning, rolling),
        priority=int(chain.number("priority", 0)),
        mix=chain.number("solmix", 1.0),
        margin=chain.number("margin", 0.0),
        softness=Softness(reference=(first, second), impedance=_plain(impedance)),
        masks=(int(chain.number("contype", 1)), int(chain.number("conaffinity", 1))),
    )


def _plain(values: Values) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def surface_values(surface: Surface) -> Mapping[str, Values]:
    """Return the numbers of a surface by attribute."""
    first, second = surface.masks
    return {"contype": (first,), "conaffinity": (second,), **attributes(surface)}


def _pair(chain: Chain) -> Mapping[str, Values]:
    """Return the numbers of a pair; those of its shapes have no effect."""
    sliding, spinning, rolling = FRICTION
    friction = (sliding, sliding, spinning, rolling, rolling)
    return {
        "condim": (chain.number("condim", 3),),
        "friction": chain.numbers("friction", friction),
        "margin": (chain.number("margin", 0.0),),
        **_softness(chain),
        "solreffriction": chain.numbers("solreffriction", (0.0, 0.0)),
    }


def orientation(chain: Chain, source: MjcfSource) -> tuple[float, ...]:
    """Return the orientation of an element as a unit quaternion (w, x, y, z)."""
    others = ORIENTATIONS.keys() - {"quat"}
    stated = (others & one.attributes.keys() for one in reversed(chain.elements))
    key = next((key for keys in stated for key in keys), "quat")  # others overrule quaternions
    numbers = np.array(chain.numbers(key, ORIENTATIONS[key]), dtype=float)
    if key == "quat":
        return tuple((numbers / np.linalg.norm(numbers)).tolist())
    if key == "axisangle":
        turn = _about(numbers[:3], numbers[3] * source.angle_unit)
    elif key == "euler":
        turn = np.eye(3)
        sequence = source.stated("compiler", "eulerseq", "xyz")
        for letter, angle in zip(sequence, numbers * source.angle_unit, strict=True):
            step = _about(np.eye(3)["xyz".index(letter.lower())], angle)
            # A lower-case letter is an axis that turns with the element.
            turn = turn @ step if letter.islower() else step @ turn
    elif key == "xyaxes":
        x, y = numbers[:3] / np.linalg.norm(numbers[:3]), numbers[3:]
        y = y - (x @ y) * x
        y = y / np.linalg.norm(y)
        turn = np.stack([x, y, cross(x, y)], axis=1)
    else:
        turn = to_axis(numbers)
    return to_quaternion(turn)


def _about(axis: Array, angle: float) -> Array:
    """Return the rotation about an axis of any length."""
    return about_axis(axis / np.linalg.norm(axis), np.array(angle), DOUBLES)


def to_axis(axis: Array) -> Array:
    """Return the smallest rotation that turns the z axis to another one."""
    normal = cross(np.array([0.0, 0.0, 1.0]), axis)
    sine = float(np.linalg.norm(normal))
    normal = normal if sine else np.array([1.0, 0.0, 0.0])
    return _about(normal, math.atan2(sine, axis[2]))

"""An MJCF as MuJoCo compiles it, as data; actuators with all their numbers."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np

from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.reference.mechanism.bodies import (
    ZERO,
    Coupling,
    ForceElement,
    Joint,
    RigidBody,
)
from physics_crosscheck.reference.mechanism.tree import Kind, TreeError
from ..compiled import CompiledActuator, CompiledShape, CompiledTree, Numbers
from ..protocol import EngineError
from .laws import laws_of
from .mjcf import UNRECOGNIZED, included, load_error, sources
from .pulls import (
    UNCOUPLED,
    acts,
    actuators,
    as_powers,
    as_quaternion,
    as_triple,
    body_name,
    box_fluid,
    control,
    couplings,
    covered_actuator,
    has_box_drag,
    joint_name,
    numbers_of,
    output,
    powers,
    pulls,
    pulls_as_computed,
    split_tendons,
)
from .shapes import (
    files_of_shapes,
    fitted_shapes,
    mesh_files,
    placed_shapes,
    with_mesh_files,
    without_idle_files,
)
from .smooth import Warnings, besides, uncovered


def compiled_actuator(m: Any, i: int) -> CompiledActuator:
    """Return the actuator with index `i`."""
    import mujoco

    kinds = (
        ("transmission", mujoco.mjtTrn(m.actuator_trntype[i])),
        ("gain", mujoco.mjtGain(m.actuator_gaintype[i])),
        ("bias", mujoco.mjtBias(m.actuator_biastype[i])),
        ("dynamics", mujoco.mjtDyn(m.actuator_dyntype[i])),
    )
    first, count = int(m.actuator_actadr[i]), int(m.actuator_actnum[i])
    return CompiledActuator(
        name=m.actuator(i).name,
        on=_target(m, i),
        kind=tuple(f"{what} {kind.name.partition('_')[2].lower()}" for what, kind in kinds),
        numbers=tuple(_force_numbers(m, i)),
        ranges=tuple(_ranges(m, i)),
        covered=covered_actuator(m, i),
        control=control(m, i),
        states=tuple(range(first, first + count)) if first >= 0 else (),
    )


def _target(m: Any, i: int) -> str:
    """Return the name of the element that it acts on; empty for other transmissions."""
    import mujoco

    kind, target = mujoco.mjtTrn(m.actuator_trntype[i]), int(m.actuator_trnid[i][0])
    if target < 0:
        return ""
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return joint_name(m, target)
    named = {
        mujoco.mjtTrn.mjTRN_TENDON: m.tendon,
        mujoco.mjtTrn.mjTRN_SITE: m.site,
        mujoco.mjtTrn.mjTRN_SLIDERCRANK: m.site,
        mujoco.mjtTrn.mjTRN_BODY: m.body,
    }
    return str(named[kind](target).name) if kind in named else ""


def _force_numbers(m: Any, i: int) -> Iterator[tuple[str, Numbers]]:
    """Yield the numbers that its force depends on while its control is held."""
    yield "gear", numbers_of(m.actuator_gear[output(m, i)])
    yield "gain and bias", (*numbers_of(m.actuator_gainprm[i]), *numbers_of(m.actuator_biasprm[i]))
    yield "dynamics", numbers_of(m.actuator_dynprm[i])
    yield "length of the crank", numbers_of(m.actuator_cranklength[i])
    if hasattr(m, "actuator_armature"):
        yield "armature", numbers_of(m.actuator_armature[i])
        yield "damping", powers(m, "actuator_damping", i)


def _ranges(m: Any, i: int) -> Iterator[tuple[str, Numbers]]:
    """Yield its saturation ranges, and features that act as its control changes."""
    index = control(m, i)
    for what, limited, bounds in (
        ("control", m.actuator_ctrllimited[index], m.actuator_ctrlrange[index]),
        ("state", m.actuator_actlimited[i], m.actuator_actrange[i]),
        ("force", m.actuator_forcelimited[i], m.actuator_forcerange[i]),
    ):
        if limited:
            yield f"{what} range", numbers_of(bounds)
    if hasattr(m, "actuator_delay") and m.actuator_delay[i]:
        yield "delay", numbers_of(m.actuator_delay[i])
    if m.actuator_actearly[i]:
        yield "early state", (1.0,)


def compiled_tree(path: Path, texts: Mapping[Path, bytes]) -> CompiledTree:
    """Compile a file and read its bodies and joints.

    Args:
        path: of the file.
        texts: replacements of it and of its includes.

    Raises:
        EngineError: naming file and reason.
    """
    xml_sources = () if texts else sources(path)
    try:
        with Warnings().collecting():
            tree, unread = _spec(path, texts)
            meshes = mesh_files(tree)
            without_idle_files(tree)
            shapes = files_of_shapes(tree)
            m: Any = _compiled(tree, unread)
    except Exception as error:
        raise load_error(error, path, xml_sources) from None
    try:
        laws, paths = _read_once(laws_of, m, path)
        return CompiledTree(
            pulls=_read_once(_pulls, m, path),
            couplings=_read_once(_couplings, m, path),
            controls=int(getattr(m, "nctrl", m.nu)),
            bodies=_read_once(_bodies, m, path),
            gravity=as_triple(m.opt.gravity) if acts(m, "GRAVITY") else ZERO,
            fluid=_read_once(box_fluid, m, path),
            name=tree.modelname,
            besides=(*_read_once(besides, m, path), *unread.items()),
            uncovered=_read_once(uncovered, m, path),
            actuators=_read_once(_actuators, m, path),
            states=int(m.na),
            shapes=shapes,
            engine_variants=_read_once(_engine_variants, m, path),
            laws=laws,
            paths=paths,
            placed=with_mesh_files(_read_once(_placed, m, path), meshes, fitted_shapes(tree)),
            options=_read_once(_options, m, path),
            excluded=_read_once(_excluded, m, path),
            others=_read_once(_others, m, path),
        )
    except TreeError as error:
        raise EngineError(str(error), file=path) from None


T = TypeVar("T")


def _read_once(part: Callable[[Any], T], m: Any, path: Path) -> T:
    """Return a part of the tree; the first one of a file, if all that it was read from is equal.

    A file is compiled again for each of its numbers, which changes few parts.
    """
    first = _first_readings(path)
    if part in first and first[part][0].is_equal(m):
        kept: T = first[part][1]
        return kept
    reading = _Reading(m)
    result = part(reading)
    first.setdefault(part, (reading, result))
    return result


@lru_cache(maxsize=1)
def _first_readings(path: Path) -> dict[Any, tuple[_Reading, Any]]:
    """Return the parts of the last file, each with the values that it was read from."""
    return {}


class _Reading:
    """A compiled model, or its options, that records which values are read from it."""

    def __init__(self, source: Any) -> None:
        self._source = source
        self._values: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._source, name)
        if callable(value):  # returns an element by index, of which only the name is read
            self._values.update((key, getattr(self._source, key)) for key in _names())
            kept: Any = partial(_named, value)
        else:
            kept = self._values[name] = _Reading(value) if name == "opt" else value
        self.__dict__[name] = kept  # read here once: these reads are a quarter of the time
        return kept

    def is_equal(self, other: Any) -> bool:
        """Return whether the values that were read are equal in another model, to the last bit."""
        if "opt" in self._values and not self._values["opt"].is_equal(other.opt):
            return False
        return all(bits == _bits(getattr(other, name)) for name, bits in self._plain_values)

    @cached_property
    def _plain_values(self) -> list[tuple[str, Any]]:
        return [(name, _bits(value)) for name, value in self._values.items() if name != "opt"]


def _bits(value: Any) -> Any:
    """Return an array's shape and bytes, or another value."""
    return (value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value


def _named(by_index: Callable[[int], Any], i: int) -> SimpleNamespace:
    """Return the name of an element by its index."""
    return SimpleNamespace(name=by_index(i).name)


@cache
def _names() -> tuple[str, ...]:
    """Return the attributes of a model that hold the names of its elements."""
    import mujoco

    return tuple(name for name in dir(mujoco.MjModel) if name == "names" or name[:5] == "name_")


def _pulls(m: Any) -> tuple[ForceElement, ...]:
    return tuple(pulls(m))


def _couplings(m: Any) -> tuple[Coupling, ...]:
    return tuple(couplings(m))


def _bodies(m: Any) -> tuple[RigidBody, ...]:
    return tuple(_body(m, i) for i in range(1, m.nbody))


def _actuators(m: Any) -> tuple[CompiledActuator, ...]:
    return tuple(compiled_actuator(m, i) for i in range(actuators(m)))


def _engine_variants(m: Any) -> tuple[tuple[str, tuple[ForceElement, ...]], ...]:
    return ((UNCOUPLED, pulls_as_computed(m)),) if any(split_tendons(m)) else ()


def _placed(m: Any) -> tuple[CompiledShape, ...]:
    return tuple(placed_shapes(m))


IDLE_FLAGS = ("ENERGY", "FWDINV", "SENSOR", "AUTORESET")
"""Flags that change no motion."""

ENUMERATIONS = {"integrator": "mjtIntegrator", "cone": "mjtCone", "solver": "mjtSolver",
                "jacobian": "mjtJacobian"}  # fmt: skip


def _options(m: Any) -> tuple[tuple[str, str], ...]:
    """Return all options, except gravity, and all flags that change motions."""
    import mujoco

    flags = "disableflags", "enableflags"
    fields = [name for name in dir(mujoco.MjOption) if name[0] != "_"]
    rows = []
    for name in fields:
        value = getattr(m.opt, name)
        if name in (*flags, "gravity") or callable(value):
            continue
        if name in ENUMERATIONS:
            text = getattr(mujoco, ENUMERATIONS[name])(value).name.partition("_")[2].lower()
        else:
            text = " ".join(map(repr, np.ravel(value).tolist()))
        rows.append((name, text))
    for field, kind, words in (
        ("disableflags", mujoco.mjtDisableBit, ("enable", "disable")),
        ("enableflags", mujoco.mjtEnableBit, ("disable", "enable")),
    ):
        for bit in kind.__members__:
            name = bit.partition("_")[2]
            if name not in IDLE_FLAGS and bit.startswith("mj") and bit[2] != "N":
                state = bool(int(getattr(m.opt, field)) & int(getattr(kind, bit)))
                rows.append((f"flag {name.lower()}", words[state]))
    return tuple(rows)


def _excluded(m: Any) -> tuple[tuple[int, int], ...]:
    return tuple((int(one) >> 16, int(one) & 0xFFFF) for one in m.exclude_signature)


OTHERS = {
    "geom": ("gap", "fluid", "surfacevel", "adhesion"),
    "pair": ("gap", "adhesion"),
    "jnt": ("springyield",),
    "tendon": ("actfrclimited", "actfrcrange", "springyield"),
}
"""Arrays that no other field contains, by kind."""

WORDS = {"jnt": "joint"}


def _others(m: Any) -> tuple[tuple[str, str, str], ...]:
    """Return numbers that are not zero, paths of tendons, and equalities."""
    import mujoco

    rows: list[tuple[str, str, str]] = []
    for kind, keys in OTHERS.items():
        elements = getattr(m, "joint" if kind == "jnt" else kind)
        for key in keys:
            values = getattr(m, f"{kind}_{key}", ())
            for i in np.flatnonzero([np.any(one) for one in values]).tolist():
                subject = f"{WORDS.get(kind, kind)} {elements(i).name or f'#{i + 1}'}"
                rows.append((subject, key, _text(values[i])))
    counts = Counter[str]()
    for i in range(m.neq):
        kind = mujoco.mjtEq(m.eq_type[i]).name.removeprefix("mjEQ_").lower()
        counts[kind] += 1
        subject, active = f"{kind} {m.eq(i).name or f'#{counts[kind]}'}", bool(m.eq_active0[i])
        rows.append((subject, "active", str(active).lower()))
        if not active:
            objects = f"{m.eq_obj1id[i]} {m.eq_obj2id[i]} {_text(m.eq_data[i])}"
            rows.append((subject, "data while inactive", objects))
    for i in range(m.ntendon):
        first, count = int(m.tendon_adr[i]), int(m.tendon_num[i])
        parts = []
        for k in range(first, first + count):
            kind = mujoco.mjtWrap(m.wrap_type[k]).name.removeprefix("mjWRAP_").lower()
            named = {"joint": m.joint, "site": m.site, "sphere": m.geom, "cylinder": m.geom}
            end = int(m.wrap_objid[k])
            name = (named[kind](end).name or f"#{end + 1}") if kind in named else ""
            parts.append(f"{kind} {name} {_text(m.wrap_prm[k])}")
        rows.append((f"tendon {m.tendon(i).name or f'#{i + 1}'}", "path", ", ".join(parts)))
    for i in range(m.nhfield):
        subject = f"hfield {m.hfield(i).name or f'#{i + 1}'}"
        shape, first = (int(m.hfield_nrow[i]), int(m.hfield_ncol[i])), int(m.hfield_adr[i])
        heights = m.hfield_data[first : first + shape[0] * shape[1]]
        content = hashlib.sha256(heights.tobytes()).hexdigest()[:12]
        rows.append((subject, "size", _text(m.hfield_size[i])))
        rows.append((subject, "elevation", f"{shape[0]} x {shape[1]} values, digest {content}"))
    return tuple(rows)


def _text(values: Any) -> str:
    return " ".join(f"{float(value):.12g}" for value in np.ravel(values))


def _spec(path: Path, texts: Mapping[Path, bytes]) -> tuple[Any, Counter[str]]:
    """Return a file without attributes that MuJoCo's schema lacks, and a count of these.

    MuJoCo refuses such a file, as one of an older format, but other engines may read it.
    """
    unread = Counter[str]()
    while True:
        try:
            return _parsed(path, texts), unread
        except ValueError as error:
            sentence = load_error(error, path, sources(path)).sentence
            ((kind, name, tag),) = UNRECOGNIZED.findall(sentence)[:1] or [("", "", "")]
            what = f"{name} of <{tag}>, which MuJoCo's format lacks"
            if kind != "attribute" or what in unread:
                raise
        stated = re.compile(rf"""(<{tag}\b[^<>]*?)\s{name}\s*=\s*("[^"]*"|'[^']*')""".encode())
        texts = {one: texts.get(one) or read_regular(one) for one in included(path)}
        changed = {one: stated.subn(rb"\1", text) for one, text in texts.items()}
        texts = {one: text for one, (text, _) in changed.items()}
        unread[what] = sum(count for _, count in changed.values())


def _compiled(tree: Any, unread: Counter[str]) -> Any:
    """Compile a file without materials; without sensors and keyframes if MuJoCo refuses these."""
    for part in (*tree.geoms, *tree.sites, *tree.tendons, *tree.meshes, *tree.skins):
        part.material = ""
    for material in tree.materials:
        material.textures = [""] * len(material.textures)
    try:
        return tree.compile()
    except ValueError:
        for part in (*tree.sensors, *tree.keys):
            unread["sensors or keyframes, which MuJoCo refuses"] += 1
            tree.delete(part)
        return tree.compile()


def _parsed(path: Path, texts: Mapping[Path, bytes]) -> Any:
    import mujoco

    if not texts:
        return mujoco.MjSpec.from_file(str(path))
    others = {}
    for part in included(path)[1:]:
        others[str(part.relative_to(path.parent))] = texts.get(part) or read_regular(part)
    text = texts.get(path) or read_regular(path)
    tree = mujoco.MjSpec.from_string(text.decode("utf-8"), include=others or None)
    tree.modelfiledir = f"{path.parent}/"
    return tree


JOINT_KINDS: tuple[Kind, ...] = ("free", "ball", "slide", "hinge")
"""Kinds of joints, as MuJoCo counts them."""


def _body(m: Any, i: int) -> RigidBody:
    first, count = int(m.body_jntadr[i]), int(m.body_jntnum[i])
    return RigidBody(
        name=body_name(m, i) or "",
        parent=body_name(m, int(m.body_parentid[i])),
        position=as_triple(m.body_pos[i]),
        quaternion=as_quaternion(m.body_quat[i]),
        mass=float(m.body_mass[i]),
        center=as_triple(m.body_ipos[i]),
        inertia=(*as_triple(m.body_inertia[i]), *ZERO),
        inertia_quaternion=as_quaternion(m.body_iquat[i]),
        joints=tuple(_joint(m, j) for j in range(first, first + count)),
        lift=float(m.body_gravcomp[i]) if acts(m, "SPRING") or acts(m, "DAMPER") else 0.0,
        dragged=has_box_drag(m, i),
    )


def _joint(m: Any, j: int) -> Joint:
    q, d = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
    kind = JOINT_KINDS[int(m.jnt_type[j])]
    joint = Joint(
        name=joint_name(m, j),
        kind=kind,
        at=ZERO if kind == "free" else as_triple(m.jnt_pos[j]),
        stiffness=as_powers(powers(m, "jnt_stiffness", j)) if acts(m, "SPRING") else 0.0,
        damping=as_powers(powers(m, "dof_damping", d)) if acts(m, "DAMPER") else 0.0,
        armature=float(m.dof_armature[d]),
    )
    if joint.single:
        low, high = map(float, m.jnt_range[j])
        return replace(
            joint,
            axis=as_triple(m.jnt_axis[j]),
            zero=float(m.qpos0[q]),
            rest=float(m.qpos_spring[q]),
            limits=(low, high) if m.jnt_limited[j] else None,
        )
    turn = q + 3 if kind == "free" else q
    return replace(
        joint,
        rest_place=as_triple(m.qpos_spring[q : q + 3]) if kind == "free" else ZERO,
        rest_turn=as_quaternion(m.qpos_spring[turn : turn + 4]),
    )

"""Generated parts of the engine pages: the matrix, and the facts and settings of each engine.

`python -m physics_crosscheck.harness.engines.pages docs/engines` renews these parts between two
markers and keeps the text around them. A test fails if they are not current.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from .protocol import DefaultLeftOn, Engine
from .pybullet.settings import DEFAULTS as PYBULLET
from .registry import BUILT_IN, install_command
from .urdf_engine import UrdfEngine

BEGIN, END = (
    "<!-- generated: python -m physics_crosscheck.harness.engines.pages docs/engines -->",
    ("<!-- end of the generated part -->"),
)
"""The markers around the generated part."""

TOPICS = (
    "joints",
    "springs",
    "mimic",
    "next state",
    "accelerations",
    "linearization",
    "steps",
    "whole step",
)
"""Columns of the matrix; each built-in engine states one phrase per topic."""

COMMON: Mapping[str, str] = MappingProxyType({
    "step": "Time step, seconds",
    "gravity": "Gravity, three numbers, m/s^2",
    "smooth": "Ignore contacts, joint limits and dry friction",
    "couplings": "Joints that keep following others; `false` releases all",
    "held": "Joints to fix where the file draws them",
    "floating": "Let the root link move freely",
    "controls": "Values at which actuators are held",
    "activations": "Start values of actuator states, which then move",
    "actuators": "Apply the actuators of an MJCF",
})  # fmt: skip
"""Settings that several engines share, with their meaning."""

HELP: Mapping[str, str] = MappingProxyType({
    "integrator": "Integrator: Euler, implicit, implicitfast or RK4",
    "solref": "Time constant and damping ratio of all equalities",
    "solimp": "Impedance of all equalities",
    "exact_frames": "Compute inertial frames within 1e-6 of the body frame exactly",
    "shape_masses": "Give links without `<inertial>` the masses of their shapes",
    "compensated": "Apply gravity compensation even if no actuator acts",
    "bits": "Precision, 32 or 64 bits",
    "link_damping": "Linear and angular damping of every link",
    "motors": "Keep the velocity motor of every joint",
    "inertia_from_file": "Use the file's inertias instead of those of collision shapes",
    "exact_axes": "Compute principal axes to the last digits",
    "unit_axes": "Normalize joint axes",
    "bare_links": "Give links without `<inertial>` 1 kg and 1 kg m^2",
    "floor": "Add a plane at z = 0 with friction 1 and restitution 1",
    "floor_speed": "Speed of that plane's surface along x, m/s: a belt",
    "scaled_inertias": "Multiply inertias by `<inertia_scaling>`",
    "damping": "Add joint damping, which the engine ignores",
    "hold_mimics": "Hold `<mimic>` joints, which the engine releases",
    "trimmed_numbers": "Remove blanks after numbers, which the parser rejects",
    "springs": "Add the springs of joints",
    "tendons": "Add springs and dampers of fixed tendons",
    "equalities": "Hold the joint equalities of an MJCF",
    "gravcomp": "Add the gravity compensation of bodies",
    "resolved": "Write defaults into each element before the engine reads the file",
    "all_roots": "Read all root bodies, not only the first",
    "all_geoms": "Give mass to geoms that touch nothing",
    "stepping": "Stepping: sap, tamsi or continuous",
    "rotors": "Apply rotor inertias and gear ratios that only Drake reads",
    "weightless_links": "Respect `<gravity>false</gravity>` of a link",
    "armature": "Add the armature of joints without an actuator",
    "chained": "Write several joints of one body as a chain of bodies",
    "couplers": "Hold `<mimic>` joints by a constraint instead of a servo",
    "exact_turns": "Integrate rotations of a floating root and of balls exactly",
    "ball_damping": "Apply the damping of ball joints",
    "screw_pitches": "Read the pitch of screws as the format defines it",
    "turned_inertials": "Respect the rotation of `<inertial><pose>`",
    "automatic_inertials": "Compute inertials with `auto=\"true\"` from the shapes",
    "default_moments": "Use the format's 1 kg m^2 for a missing `<inertia>`",
    "corrected_inertias": "Let Newton enlarge small moments, and drop those without mass",
    "collapse_fixed_joints": "Merge welded links as Newton does, with wrong inertias",
    "articulations": "Put joints of a USD stage without articulation root into one",
    "massless_links": "Keep the moments of links without mass",
    "joint_friction": "Friction coefficient of every joint",
    "bounded_speeds": "Limit the speeds of links and joints as the engine does",
    "angular_damping": "Angular damping of every link, 1/s, unless the file states it",
    "root_as_stated": "Free a fixed base whose body has the articulation root, as PhysX does",
    "dropped_inertials": "Give links without mass or moments the inertia of SAPIEN",
    "solver": "Solver: PGS or TGS",
    "collision_slop": "Overlap of shapes that is not corrected, m (`Space.collision_slop`)",
})  # fmt: skip
"""Settings of single engines, with their meaning."""

_SPACE: Mapping[str, str] = MappingProxyType({
    "damping": "Share of its velocity that a body keeps in a second (`Space.damping`)"
})  # fmt: skip

_MUJOCO: Mapping[str, object] = MappingProxyType({
    "integrator": "of the file", "solref": "of the file", "solimp": "of the file",
    "exact_frames": False, "compensated": False, "shape_masses": True,
})  # fmt: skip

_ADAPTER_DEFAULTS: Mapping[str, Mapping[str, object]] = MappingProxyType({
    "mujoco": _MUJOCO,
    "mjx": {**_MUJOCO, "bits": 64},
    "pybullet": PYBULLET,
    "pymunk": {"damping": "of the file", "collision_slop": "of the file"},
})  # fmt: skip
"""Defaults of adapters that are not `UrdfEngine`s."""


def own_settings(engine: Engine) -> dict[str, object]:
    """Return the defaults of the settings that are not common to all engines."""
    every = engine.defaults if isinstance(engine, UrdfEngine) else _ADAPTER_DEFAULTS[engine.name]
    return {key: default for key, default in every.items() if key not in COMMON}


def common_settings(engine: Engine) -> tuple[str, ...]:
    """Return the common settings that an engine takes."""
    names = {"step", "gravity", *engine.switches}
    if engine.switches and ".urdf" in engine.formats:
        names.add("floating")
    return tuple(key for key in COMMON if key in names)


def phrases(engine: Engine) -> dict[str, str]:
    """Return what an engine can do, by topic.

    Raises:
        ValueError: if a topic is missing.
    """
    topics = dict(phrase.split(": ", 1) for phrase in engine.capabilities)
    if tuple(topics) != TOPICS:
        raise ValueError(f"{engine.name}: its capabilities are not of {', '.join(TOPICS)}")
    return topics


def matrix() -> str:
    """Return the table of all built-in engines."""
    heads = ("engine", "files", *TOPICS, "extra")
    rows = [heads, ("---",) * len(heads)]
    for engine in (kind() for kind in BUILT_IN):
        by_topic = phrases(engine)
        rows.append((
            f"[{engine.title}]({engine.name}.md)",
            _formats(engine),
            *(by_topic[topic] for topic in TOPICS),
            f"`{engine.extra or 'engines'}`",
        ))  # fmt: skip
    return _table(rows)


def facts(engine: Engine) -> str:
    """Return the facts, settings and common mistakes of one engine; the matrix has the phrases."""
    rows = [
        ("fact", "value"),
        ("---", "---"),
        ("files", _formats(engine)),
        ("installation", f"`{install_command(engine)}`"),
    ]
    if engine.massless_link_default:
        rows.append(("mass of a URDF link without `<inertial>`", engine.massless_link_default))
    if engine.ignores:
        rows.append(("ignored numbers", ", ".join(f"`{one}`" for one in sorted(engine.ignores))))
    common = ", ".join(f"`{key}`" for key in common_settings(engine))
    compared = "[Engines](index.md) compares joints, springs, steps and features.\n"
    parts = [_table(rows), compared, f"## Settings\n\nCommon settings: {common}.\n"]
    defaults = own_settings(engine)
    if defaults:
        meanings = {**HELP, **(_SPACE if engine.name == "pymunk" else {})}
        lines = [(f"`{key}`", _value(defaults[key]), meanings[key]) for key in defaults]
        parts.append(_table([("setting", "default", "meaning"), ("---",) * 3, *lines]))
    if engine.usual_mistakes:
        mistakes = [
            (one.name, f"`{one.setting} = {_toml(one.value)}`")
            if isinstance(one, DefaultLeftOn)
            else (one.name, ", ".join(f"`{key}`" for key in one.defaults))
            for one in engine.usual_mistakes
        ]
        parts.append("## Common mistakes\n\n`crosscheck mutate` makes each of them.\n")
        parts.append(_table([("mistake", "setting"), ("---", "---"), *mistakes]))
    return "\n".join(parts)


def renewed(text: str, part: str) -> str:
    """Return a page with its generated part replaced.

    Raises:
        ValueError: without both markers.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the page has no part between {BEGIN} and {END}")
    return f"{before}{BEGIN}\n\n{part}\n{END}{after}"


def pages(folder: Path) -> dict[Path, str]:
    """Return every page with its generated part renewed."""
    parts = {"index": matrix() + "\n" + _common_table()}
    parts |= {engine.name: facts(engine) for engine in (kind() for kind in BUILT_IN)}
    files = {folder / f"{name}.md": part for name, part in parts.items()}
    return {path: renewed(path.read_text(encoding="utf-8"), part) for path, part in files.items()}


def _common_table() -> str:
    rows = [(f"`{key}`", meaning) for key, meaning in COMMON.items()]
    table = _table([("setting", "meaning"), ("---", "---"), *rows])
    return f"## Common settings\n\nEach engine's page lists which of these it takes.\n\n{table}"


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _formats(engine: Engine) -> str:
    return ", ".join(f"`{one}`" for one in engine.formats)


def _value(value: object) -> str:
    return str(value) if value == "of the file" else f"`{_toml(value)}`"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


if __name__ == "__main__":
    for page, text in pages(Path(sys.argv[1])).items():
        page.write_text(text, encoding="utf-8")

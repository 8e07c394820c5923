"""Write system.py and the sidecar of a mechanism that was read from a file."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterable, Sequence

from physics_crosscheck.harness.commands.scaffold.constants import ConstantRow, Ledger
from physics_crosscheck.harness.commands.scaffold.mechanism import (
    FormulaBody,
    FormulaJoint,
    Mechanism,
    Triple,
    Turn,
)
from physics_crosscheck.harness.commands.scaffold.scenarios import ScenarioPlan
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.reference.mechanism.pose import WORLD

_WIDTH = 100
_STRING_OR_COMMENT = re.compile(r'"(?:\\.|[^"\\])*"|#.*')


def system_text(
    name: str, file: str, mechanism: Mechanism, rows: Sequence[ConstantRow], plan: ScenarioPlan
) -> str:
    """Return the text of system.py; text of the model file appears in literals only."""
    joints, file = mechanism.joints, plain(file)
    body = "\n".join(
        [
            f'""{quoted(f"The physics of {name}, read from {file} by `crosscheck new`.")}""',
            "",
            "SYMPYfrom physics_crosscheck import (",
            "    Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, ground, t,",
            ")",
            "",
            *comment(
                f"The text below was derived from {file} itself, so it checks the "
                f"engines, and\n            every later edit of {file}: but not yet "
                f"{file} against what you mean. For that, replace\n            the "
                "constants by your own, from drawings and data sheets, write numbers "
                "that follow\n            from others as formulas (m * l**2 / 12), and "
                "the energies as you would on paper. Then\n            the bindings in "
                f"{file}.toml, which state where each number comes from."
            ),
            "",
            "# Coordinates, named like the joints.",
            *(_coordinate(joint) for joint in joints),
            "",
            "# Every number of the file but zeros and axes, with the line that it stands in.",
            *(line for row in rows for line in _constant(row)),
            "",
            "# A force on every joint, to drive it with.",
            *(_input(joint) for joint in joints),
            "",
            "# The tree: each body's frame in its parent's, and its centre of mass.",
            *(line for one in mechanism.bodies for line in _frames(one)),
            "",
            *_energies(mechanism),
            "",
            "system = System(",
            f"    name={quoted(name)},",
            f"    title={quoted(name.replace('_', ' '))},",
            f"    source={quoted(f'{file}, read by crosscheck new')},",
            f"    coordinates={_tuple(j.symbol for j in joints)},",
            f"    constants={_tuple(row.name for row in rows)},",
            f"    inputs={_tuple(j.force for j in joints)},",
            "    outputs=(",
            *(
                f"        Output({quoted(j.symbol)}, {j.symbol}.q, {quoted(_unit(j))},"
                f" {quoted(f'position of {j.name}')}),"
                for j in joints
            ),
            "    ),",
            "    T=T,",
            "    V=V,",
            "    D=D,",
            *plan.lines(joints, [j.force for j in joints]),
            "    # Where each body is; the sidecar names it in the file.",
            "    frames=(",
            *(f"        {_pose(body)}," for body in mechanism.bodies if body.place),
            "    ),",
            "    published=(),",
            ")",
            "",
        ]
    )
    code = _STRING_OR_COMMENT.sub("", body)
    used = [word for word in ("pi", "sin") if re.search(rf"\b{word}\b", code)]
    return body.replace("SYMPY", f"from sympy import {', '.join(used)}\n\n" if used else "", 1)


def sidecar_text(
    file: str,
    engines: Sequence[Engine],
    mechanism: Mechanism,
    ledger: Ledger,
    left_out: dict[str, str],
    settings: Sequence[str],
) -> str:
    """Return the sidecar: engines, settings that the format lacks, the source of each number."""
    lines = [f"# The sidecar of {plain(file)}: settings that the file itself can't express."]
    lines += [f"# Left out: {plain(f'{name}: {why}')}" for name, why in left_out.items()]
    lines += [f"engines = [{', '.join(quoted(e.name) for e in engines)}]", ""]
    lines += settings
    for engine in engines if settings else ():
        if engine.stated_settings:
            stated = [f"{key} = {literal(value)}" for key, value in engine.stated_settings.items()]
            lines += [f"[settings.{engine.name}]", *stated, ""]
    renamed = [joint for joint in mechanism.joints if joint.name != joint.symbol]
    if renamed:
        lines += ["# Joints whose names no formula could hold.", "[coordinates]"]
        lines += [f"{quoted(joint.name)} = {quoted(joint.symbol)}" for joint in renamed]
        lines += ["", "[readback]"]
        lines += [f"{joint.symbol} = {quoted(joint.name)}" for joint in renamed]
        lines += [""]
    places = [body.place for body in mechanism.bodies if body.place]
    if places:
        lines += ["# What each of the system's frames is in the file.", "[frames]"]
        lines += [f"{quoted(_named(place))} = {quoted(place)}" for place in places]
        lines += [""]
    lines += [
        "# What each number stands for: with it, a wrong one is named with its line.",
        "[bindings]",
    ]
    for address, formula in ledger.bindings.items():
        lines += [f"{quoted(address)} = {quoted(formula)}"]
        if others := ledger.shared.get(address):
            lines += [f"# The same number is {', '.join(others)} too: change them together."]
    return "\n".join(lines) + "\n"


def _coordinate(joint: FormulaJoint) -> str:
    kind = "hinge about" if joint.hinge else "slide along"
    what = f"{kind} {_axis(joint.axis)}, {joint.where}"
    if joint.limits is not None:
        what += f", from {joint.limits[0]:g} to {joint.limits[1]:g}"
    return f"{joint.symbol} = Coordinate({quoted(joint.symbol)}, {quoted(_unit(joint))}, " + (
        f"{quoted(what)})"
    )


def _pose(body: FormulaBody) -> str:
    kind, name = body.place.partition(":")[0], _named(body.place)
    return f"{body.symbol}.pose({quoted(name)}, {quoted(f'{kind} {body.name}')})"


def _named(place: str) -> str:
    """Return the system's name of a body: the file's name, unless that word is reserved."""
    name = place.partition(":")[2]
    return f"{name}_" if name == WORLD else name


def _constant(row: ConstantRow) -> list[str]:
    parts = (
        f"{quoted(row.name)}, {row.value!r}, {quoted(row.unit)},",
        f"{quoted(row.description)}, {quoted(row.source)}",
    )
    line = f"{row.name} = Constant({' '.join(parts)})"
    if len(line) <= _WIDTH:
        return [line]
    return [f"{row.name} = Constant({parts[0]}", f"    {parts[1]})"]


def _input(joint: FormulaJoint) -> str:
    unit = "N*m" if joint.hinge else "N"
    name = joint.force
    return (
        f"{name} = Input({quoted(name)}, {quoted(unit)}, {quoted(f'drives {joint.name}')},"
        f" on={{{joint.symbol}: 1}})"
    )


def _frames(body: FormulaBody) -> list[str]:
    steps = [*_shift(body.position), *map(_turn, body.turns)]
    for joint in body.joints:
        word = f"hinge({joint.symbol}, about=" if joint.hinge else f"slide({joint.symbol}, along="
        zero = "" if joint.zero == "0" else f", zero={joint.zero}"
        back = (_minus(joint.position[0]), _minus(joint.position[1]), _minus(joint.position[2]))
        steps += [*_shift(joint.position), f".{word}{_axis(joint.axis)}{zero})", *_shift(back)]
    lines = _chain(body.symbol, body.parent, steps)
    if body.heavy:
        inner = [*_shift(body.centre), *map(_turn, body.principal)]
        lines += _chain(body.centred, body.symbol, inner)
    return lines


def _chain(name: str, start: str, steps: Sequence[str]) -> list[str]:
    line = f"{name} = {start}{''.join(steps)}"
    if len(line) <= _WIDTH:
        return [line]
    return [f"{name} = (", f"    {start}", *(f"    {step}" for step in steps), ")"]


def _shift(offset: Triple) -> list[str]:
    return [] if offset == ("0", "0", "0") else [f".at({', '.join(offset)})"]


def _turn(turn: Turn) -> str:
    return f".turned({_axis(turn.axis)}, {turn.angle})"


def _minus(formula: str) -> str:
    return "0" if formula == "0" else formula[1:] if formula[0] == "-" else f"-{formula}"


def _energies(mechanism: Mechanism) -> list[str]:
    heavy = [body for body in mechanism.bodies if body.heavy]
    kinetic = []
    for b in heavy:
        products = "" if b.products == ("0", "0", "0") else f", ({', '.join(b.products)})"
        kinetic.append(f"{b.centred}.kinetic({b.mass}, ({', '.join(b.moments)}){products})")
    potential = [
        f"{b.centred}.weight({b.mass}, ({', '.join(mechanism.gravity)}))"
        for b in heavy
        if b.mass != "0" and mechanism.gravity != ("0", "0", "0")
    ]
    dissipated = []
    for joint in mechanism.joints:
        if joint.armature != "0":
            kinetic.append(f"{joint.armature} * {joint.symbol}.v ** 2 / 2")
        if joint.stiffness != "0":
            stretch = f"{joint.symbol}.q"
            if joint.rest != "0":
                stretch = f"({stretch} - {joint.rest})".replace("- -", "+ ")
            potential.append(f"{joint.stiffness} * {stretch} ** 2 / 2")
        if joint.damping != "0":
            dissipated.append(f"{joint.damping} * {joint.symbol}.v ** 2 / 2")
    return [
        "# Kinetic energy, potential energy, and half the power that friction takes.",
        *_sum("T", kinetic),
        *_sum("V", potential),
        *_sum("D", dissipated),
    ]


def _sum(name: str, parts: Sequence[str]) -> list[str]:
    if len(parts) < 2:
        return [f"{name} = {parts[0] if parts else 0}"]
    return [f"{name} = (", f"    {parts[0]}", *(f"    + {term}" for term in parts[1:]), ")"]


def _axis(axis: Sequence[float]) -> str:
    return f"({', '.join(str(int(a)) if a == int(a) else repr(a) for a in axis)})"


def _unit(joint: FormulaJoint) -> str:
    return "rad" if joint.hinge else "m"


def _tuple(names: Iterable[str]) -> str:
    items = list(names)
    line = f"({', '.join(items)}{',' if len(items) == 1 else ''})"
    if len(line) < _WIDTH - 20:
        return line
    wrapped = textwrap.wrap(", ".join(items) + ",", _WIDTH - 10)
    return "(\n" + "\n".join(f"        {part}" for part in wrapped) + "\n    )"


def comment(text: str) -> list[str]:
    """Return the lines of a comment."""
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.split()), _WIDTH - 2)]


def literal(value: object) -> str:
    """Format a setting as TOML."""
    return quoted(value) if isinstance(value, str) else json.dumps(value)


def plain(text: str) -> str:
    """Make text safe for a comment: one line, without hidden characters."""
    return "".join(c if c.isprintable() else "?" for c in text)


def quoted(text: str) -> str:
    """Return a string literal that Python and TOML read as the same text, for any name of a joint.

    Lone surrogates, from file names that are not UTF-8, become question marks, since TOML has none.
    """
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(c: str) -> str:
    if c in '"\\':
        return f"\\{c}"
    if c.isprintable():
        return c
    code = ord(c)
    if 0xD800 <= code < 0xE000:
        return "?"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"

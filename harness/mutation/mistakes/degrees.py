"""Confusion of degrees and radians."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.mutation.mistakes.rests import moved_rest, radian
from physics_crosscheck.harness.records.cause import CauseId

ANGLES = r"(body|frame|joint)@(euler|axisangle|ref|springref)"


def degrees(subject: Subject) -> Iterator[Mistake]:
    """Yield a missing or a wrong `angle` of MJCF; a URDF's angles in degrees."""
    turns = {name: joint for name, joint in subject.joints() if _turns(joint.attributes)}
    causes = frozenset[CauseId]().union(*(moved_rest(subject, name) for name in turns))
    if subject.suffix == ".xml":
        sliding = {name for name, _ in subject.joints()} - set(turns)
        stated = {
            address: value
            for address, value in subject.numbers(ANGLES).items()
            if value and not any(f"joint[{name}]@" in address for name in sliding)
        }
        compiler = next((e for e in subject.elements if e.tag == "compiler"), None)
        if stated and compiler is not None:
            stated_unit = None if radian(subject) else "radian"
            name = "degrees for radians" if stated_unit is None else "radians for degrees"
            edit = Edit(attributes=(Attribute(compiler.start, "angle", stated_unit),))
            yield Mistake(name, "compiler@angle", edit, causes | literal_causes(*stated))
    elif subject.suffix == ".urdf":
        kinds = r"springReference|origin@rpy"
        for address, value in subject.numbers(kinds).items():
            drawn = any(word in address for word in ("visual", "collision"))
            spring = any(address == f"gazebo[{name}]/springReference" for name in turns)
            if value and not drawn and (spring or "@rpy" in address):
                edit = Edit({address: math.degrees(value)})
                yield Mistake(
                    "degrees for radians", address, edit, causes | literal_causes(address)
                )


def _turns(attributes: Mapping[str, str]) -> bool:
    return attributes.get("type", "hinge") in ("hinge", "revolute", "continuous")

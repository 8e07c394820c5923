"""Springs with a wrong rest position."""

import re
from collections.abc import Iterator

from physics_crosscheck.harness.modelfiles.bindings import SIDECAR
from physics_crosscheck.harness.records.cause import CauseId
from .context import Edit, Mistake, Subject, literal_causes, rounded

SHARE = 0.1
"""Offset as a share of the joint's largest movement."""

REST = re.compile(r"rest|relaxed|slack|springref|reference", re.IGNORECASE)
"""Names that suggest a rest length among the numbers of a Python file."""


def rests(subject: Subject) -> Iterator[Mistake]:
    """Yield each spring with its rest position moved; for a tendon, chosen by the engine."""
    if subject.suffix == ".xml":
        yield from _joints(subject)
        yield from _tendons(subject)
    elif subject.suffix == ".urdf":
        yield from _gazebo(subject)
    elif subject.suffix == ".py":
        yield from _python(subject)
    yield from _declared(subject)


def _joints(subject: Subject) -> Iterator[Mistake]:
    """Yield the springref of joints, in degrees if the file's angles are."""
    for name, joint in subject.joints():
        if float(joint.attributes.get("stiffness", "0").split()[0]) == 0:
            continue
        unit = 57.3 if joint.attributes.get("type") != "slide" and not radian(subject) else 1.0
        old = float(joint.attributes.get("springref", "0"))
        new = old + rounded(SHARE * unit * subject.max_travel(name))
        yield Mistake(
            "a rest offset",
            name,
            Edit(attributes=((joint.start, "springref", repr(new)),)),
            moved_rest(subject, name) | literal_causes(f"{joint.spelled(1)}@springref"),
        )


def radian(subject: Subject) -> bool:
    """Return whether an MJCF file's angles are in radians."""
    compilers = [e for e in subject.elements if e.tag == "compiler"]
    return any(e.attributes.get("angle") == "radian" for e in compilers)


def _tendons(subject: Subject) -> Iterator[Mistake]:
    for tendon in subject.elements:
        if tendon.tag != "fixed" or "stiffness" not in tendon.attributes:
            continue
        names = [c.attributes["joint"] for c in tendon.children if "joint" in c.attributes]
        names = [name for name in names if name in subject.model.coordinates]
        if "springlength" not in tendon.attributes or not names:
            continue
        place, address = tendon.spelled(1), f"{tendon.spelled(1)}@springlength"
        causes = literal_causes(address).union(*(moved_rest(subject, name) for name in names))
        words = tendon.attributes["springlength"].split()
        new = float(words[0]) + rounded(SHARE * max(subject.max_travel(name) for name in names))
        edit = Edit(attributes=((tendon.start, "springlength", repr(new)),))
        yield Mistake("a rest offset", place, edit, causes)
        # -1 is the default: relaxed at the length in the file's pose.
        edit = Edit(attributes=((tendon.start, "springlength", None),))
        yield Mistake("springlength left at -1", place, edit, causes)


def _gazebo(subject: Subject) -> Iterator[Mistake]:
    """Yield changes of Gazebo's springReference."""
    stated = subject.numbers("springReference")
    for name, _ in subject.joints():
        address = f"gazebo[{name}]/springReference"
        if address in stated:
            new = stated[address] + rounded(SHARE * subject.max_travel(name))
            causes = moved_rest(subject, name) | literal_causes(address)
            yield Mistake("a rest offset", name, Edit({address: new}), causes)


def _python(subject: Subject) -> Iterator[Mistake]:
    """Yield unbound numbers whose names suggest a rest length."""
    causes = frozenset[CauseId]().union(
        *(moved_rest(subject, z) for z in subject.model.coordinates)
    )
    for name, value in subject.numbers("").items():
        if REST.search(name) and name not in subject.bound:
            new = value * (1 + SHARE) if value else SHARE
            yield Mistake("a rest offset", name, Edit({name: new}), causes | literal_causes(name))


def _declared(subject: Subject) -> Iterator[Mistake]:
    """Yield changes of the springs in the sidecar."""
    for index, spring in enumerate(subject.task.declared.springs):
        joints = [name for name in spring.joints if name in subject.model.coordinates]
        if spring.stiffness and joints:
            address = f"{SIDECAR}spring[{index}].rest"
            new = spring.rest + rounded(SHARE * max(map(subject.max_travel, joints)))
            causes = literal_causes(address).union(*(moved_rest(subject, name) for name in joints))
            yield Mistake("a rest offset", address, Edit({address: new}), causes)


def moved_rest(subject: Subject, joint: str) -> frozenset[CauseId]:
    """Return the equivalent causes of a moved rest position: a constant force, or a joint
    offset.
    """
    return subject.about(joint, "offset force") | {CauseId(kind="zero", subject=(joint,))}

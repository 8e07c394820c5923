"""Joints of a URDF that follow others, as far as every engine can hold them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from physics_crosscheck.harness.files.brief import brief
from physics_crosscheck.harness.robots.document import Document
from physics_crosscheck.harness.robots.urdf_parts import UrdfJoint
from physics_crosscheck.reference.multibody.bodies import Coupling


class Mimic(NamedTuple):
    """A joint's leader, by its name, and its multiplier."""

    leader: str
    multiplier: float


def read_mimics(document: Document, joints: Mapping[str, UrdfJoint]) -> dict[str, Mimic]:
    """By the following joint's name.

    A gear holds rates, so that one with an offset, or with the multiplier zero, is none; it is left
    free, as is one whose leader is no hinge and no slide, or that follows itself by way of others.
    """
    found: dict[str, Mimic] = {}
    for name, joint in joints.items():
        mimic = document.child(joint.element, "mimic")
        if mimic is None or joint.kind not in ("hinge", "slide"):
            continue
        leader = joints.get(mimic.attributes.get("joint", ""))
        what = f"<mimic> of joint {brief(name)}"
        multiplier = document.number(mimic, "multiplier", 1.0, what)
        offset = document.number(mimic, "offset", 0.0, what)
        single = leader is not None and leader.kind in ("hinge", "slide")
        if leader is not None and single and multiplier and not offset:
            found[name] = Mimic(leader.name, multiplier)
    return acyclic(found)


def acyclic(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Those that do not follow themselves by way of others."""
    return {name: one for name, one in mimics.items() if not _circular(name, mimics)}


def _circular(name: str, mimics: Mapping[str, Mimic]) -> bool:
    passed: set[str] = set()
    while name in mimics and name not in passed:
        passed.add(name)
        name = mimics[name].leader
    return name in passed


def couplings(mimics: Mapping[str, Mimic]) -> tuple[Coupling, ...]:
    """The same as couplings of joints."""
    return tuple(
        Coupling(follower=name, leader=one.leader, multiplier=one.multiplier)
        for name, one in mimics.items()
    )

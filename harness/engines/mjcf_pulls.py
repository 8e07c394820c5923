"""What pulls at the joints of an MJCF: springs, fixed tendons and actuators at held controls."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.engines.mjcf_defaults import (
    MOTORS,
    Attributes,
    Defaults,
    number_of,
    numbers_of,
)
from physics_crosscheck.harness.engines.mjcf_joints import HINGE, SLIDE, MjcfJoint
from physics_crosscheck.harness.engines.mjcf_source import MjcfSource
from physics_crosscheck.harness.engines.protocol import Spring

AUTOMATIC = -1.0
"""As MuJoCo compares it: other lengths below zero are lengths."""


@dataclass(frozen=True, kw_only=True)
class Actuated:
    """An actuator at its control: a held force on a combination of joints, and what it resists.

    Attributes:
        joints: names of joints -> by how much each moves it.
        force: N or N m, along the combination.
        stiffness, damping: that it loses by position and by velocity.
    """

    joints: Mapping[str, float]
    force: float
    stiffness: float
    damping: float


@dataclass(frozen=True, kw_only=True)
class Pulls:
    """Reads what pulls; `joints` are those that move, `refs` where others stand, by name."""

    source: MjcfSource
    defaults: Defaults
    joints: Mapping[str, MjcfJoint]
    refs: Mapping[str, float]

    def springs(self) -> Iterator[Spring]:
        """Of slides and hinges.

        Raises:
            EngineError: for what has a spring and is neither.
        """
        on = not self.source.disabled("spring")
        for name, one in self.joints.items():
            if one.kind in (SLIDE, HINGE):
                if one.stiffness and on:
                    yield Spring({name: 1.0}, one.stiffness, 0.0, one.rest)
            elif one.stiffness or one.damping:
                raise self.source.unsupported(
                    one.element, f"a spring or damper of a {one.kind} joint is not added here"
                )

    def tendons(self) -> Iterator[Spring]:
        """Springs and dampers of fixed tendons.

        Raises:
            EngineError: for tendons that pull otherwise.
        """
        for tendon in self.source.root.findall("tendon/*"):
            said = self.defaults.of(tendon, tag="tendon")
            numbers = {
                key: number_of(self.source, tendon, said, key)
                for key in ("stiffness", "damping", "armature")
            }
            for key, flag in (("stiffness", "spring"), ("damping", "damper")):
                numbers[key] *= not self.source.disabled(flag)
            if not any(numbers.values()):
                continue
            if tendon.tag != "fixed" or numbers["armature"]:
                kind = "a tendon with armature" if numbers["armature"] else "a tendon between sites"
                raise self.source.unsupported(tendon, f"{kind} that pulls is not added here")
            shares = self.shares(tendon)
            rest = self._rest(tendon, said, shares) if numbers["stiffness"] else 0.0
            yield self._free(shares, numbers["stiffness"], numbers["damping"], rest)

    def shares(self, tendon: ET.Element) -> dict[str, float]:
        """Joints of a fixed tendon, also those that stand still, and its coefficients."""
        found: dict[str, float] = {}
        for one in tendon.findall("joint"):
            name = one.get("joint", "")
            moved = self.joints.get(name)
            if name not in self.refs and (moved is None or moved.kind not in (SLIDE, HINGE)):
                raise self.source.refused(one, f"{name!r} is neither a slide nor a hinge")
            found[name] = found.get(name, 0.0) + number_of(
                self.source, one, one.attrib, "coef", "nan"
            )
        return found

    def _rest(self, tendon: ET.Element, said: Attributes, shares: Mapping[str, float]) -> float:
        """At which length it is relaxed: -1, which is no length, where the joints' springs are."""
        length = numbers_of(self.source, tendon, said, "springlength", "-1")
        if length[0] != length[-1]:
            raise self.source.unsupported(tendon, "a tendon that is slack between two lengths")
        if length[0] == AUTOMATIC:
            at = {**self.refs, **{name: one.rest for name, one in self.joints.items()}}
            return sum(share * at[name] for name, share in shares.items())
        return length[0]

    def _free(self, shares: Mapping[str, float], k: float, c: float, rest: float) -> Spring:
        """Of the joints that move alone."""
        still = sum(share * self.refs[name] for name, share in shares.items() if name in self.refs)
        moving = {name: share for name, share in shares.items() if name not in self.refs}
        return Spring(moving, k, c, rest - still)

    def actuators(self, controls: Sequence[float]) -> Iterator[Actuated]:
        """Those that pull in proportion, at these controls, one for each.

        Raises:
            EngineError: for actuators of other laws, and where there are more controls or fewer.
        """
        rows = self.source.root.findall("actuator/*")
        if len(controls) != len(rows):
            wanted = "1 number" if len(rows) == 1 else f"{len(rows)} numbers"
            sentence = f"[settings] controls is {list(controls)}; expected {wanted}"
            raise self.source.refused(rows[0], sentence)
        for one, control in zip(rows, controls, strict=True):
            said = self._said(one)
            length, gear = self._length(one, said)
            if not {name for name in length if name in self.joints}:
                continue  # it stands still, and its actuator goes with it
            gain, bias = self._law(one, said)
            still = sum(by * self.refs[name] for name, by in length.items() if name in self.refs)
            yield Actuated(
                joints={k: gear * by for k, by in length.items() if k not in self.refs},
                force=gain * control + bias[0] + bias[1] * gear * still,
                stiffness=-bias[1],
                damping=-bias[2],
            )

    def _said(self, one: ET.Element) -> Attributes:
        if one.tag not in MOTORS or self.defaults.mixed(one, MOTORS):
            raise self.source.unsupported(one, f"an actuator <{one.tag}> of these defaults or laws")
        said = self.defaults.of(one)
        if said.get("gaintype", "fixed") != "fixed" or said.get("dyntype", "none") != "none":
            raise self.source.unsupported(one, "an actuator with a state or a gain of a law")
        for key in ("armature", "damping", "delay", "timeconst"):
            if any(numbers_of(self.source, one, said, key, "0")):
                raise self.source.unsupported(one, f"an actuator with {key} is not added here")
        return said

    def _length(self, one: ET.Element, said: Attributes) -> tuple[Mapping[str, float], float]:
        """Combination of joints that it pulls along, and its gear."""
        gear = numbers_of(self.source, one, said, "gear", "1")[0]
        joint, tendon = said.get("joint", said.get("jointinparent", "")), said.get("tendon", "")
        if joint in self.refs or (
            joint in self.joints and self.joints[joint].kind in (SLIDE, HINGE)
        ):
            return {joint: 1.0}, gear
        for fixed in self.source.root.findall("tendon/fixed") if tendon else ():
            if fixed.get("name") == tendon:
                return self.shares(fixed), gear
        raise self.source.unsupported(one, "an actuator on no slide, hinge or fixed tendon")

    def _law(self, one: ET.Element, said: Attributes) -> tuple[float, tuple[float, float, float]]:
        """Gain, and bias by nothing, by length and by its rate."""

        def at(key: str, otherwise: str) -> float:
            return numbers_of(self.source, one, said, key, otherwise)[0]

        if one.tag == "motor":
            return 1.0, (0.0, 0.0, 0.0)
        if one.tag == "position" and not at("dampratio", "0"):
            return at("kp", "1"), (0.0, -at("kp", "1"), -at("kv", "0"))
        if one.tag == "velocity":
            return at("kv", "1"), (0.0, 0.0, -at("kv", "1"))
        affine = said.get("biastype", "none") in ("none", "affine")
        if one.tag != "general" or not affine:
            raise self.source.unsupported(
                one, f"an actuator <{one.tag}> of this law is not added here"
            )
        if said.get("biastype", "none") == "none":
            return at("gainprm", "1"), (0.0, 0.0, 0.0)
        given = numbers_of(self.source, one, said, "biasprm", "0")
        zero, length, rate = (*given, 0.0, 0.0, 0.0)[:3]
        return at("gainprm", "1"), (zero, length, rate)

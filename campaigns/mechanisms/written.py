"""Model files of mechanisms in MJCF and URDF; every number has all its digits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from campaigns.mechanisms.mechanism import MJCF, MechanismLink, RandomMechanism
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar


def sidecar(mechanism: RandomMechanism, folder: Path, more: Mapping[str, object]) -> Sidecar:
    """Write the model file into a folder; return its sidecar, with additional settings."""
    mjcf = mechanism.format == MJCF
    path = folder / ("mechanism.xml" if mjcf else "mechanism.urdf")
    path.write_text((_mjcf if mjcf else _urdf)(mechanism), encoding="utf-8")
    settings: dict[str, object] = {**more}
    if not mjcf:
        settings |= {"step": mechanism.step, "gravity": list(mechanism.gravity)}
        if mechanism.integrator:
            settings["integrator"] = mechanism.integrator
    return Sidecar(
        model=path,
        engines=(mechanism.engine,),
        settings=settings,
        engine_settings={},
        coordinates={},
        readback={},
        springs=(),
    )


def joint_name(index: int) -> str:
    """Return the name of a link's joint and of its coordinate."""
    return f"q{index + 1}"


def _words(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))


def _mjcf(mechanism: RandomMechanism) -> str:
    bodies = "\n".join(_body(mechanism, i) for i in _children(mechanism, -1))
    return (
        '<mujoco><compiler angle="radian"/>\n'
        f'<option timestep="{mechanism.step!r}" gravity="{_words(mechanism.gravity)}"'
        f' integrator="{mechanism.integrator}" jacobian="dense"/>\n'
        f"<worldbody>\n{bodies}\n</worldbody></mujoco>\n"
    )


def _children(mechanism: RandomMechanism, parent: int) -> list[int]:
    return [i for i, link in enumerate(mechanism.links) if link.parent == parent]


def _body(mechanism: RandomMechanism, index: int) -> str:
    link = mechanism.links[index]
    inertia = "diaginertia" if len(link.inertia) == 3 else "fullinertia"
    turn = f' quat="{_words(link.inertial_turn)}"' if link.inertial_turn else ""
    within = "".join("\n" + _body(mechanism, i) for i in _children(mechanism, index))
    return (
        f'<body name="body{index + 1}" pos="{_words(link.position)}" quat="{_words(link.turn)}">\n'
        f'<joint name="{joint_name(index)}" type="{"hinge" if link.hinge else "slide"}"'
        f' pos="{_words(link.anchor)}" axis="{_words(link.axis)}" ref="{link.reference!r}"'
        f' stiffness="{link.stiffness!r}" springref="{link.rest!r}" damping="{link.damping!r}"'
        f' armature="{link.armature!r}"/>\n'
        f'<inertial pos="{_words(link.centre)}"{turn} mass="{link.mass!r}"'
        f' {inertia}="{_words(link.inertia)}"/>{within}</body>'
    )


def _urdf(mechanism: RandomMechanism) -> str:
    parts = [_urdf_link(i, link) for i, link in enumerate(mechanism.links)]
    base = (
        '<link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    return "\n".join(['<robot name="mechanism">', base, *parts, "</robot>\n"])


def _urdf_link(index: int, link: MechanismLink) -> str:
    name = joint_name(index)
    parent = "base" if link.parent < 0 else f"body{link.parent + 1}"
    entries = zip(
        ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (*link.inertia, 0.0, 0.0, 0.0)[:6], strict=True
    )
    inertia = " ".join(f'{key}="{value!r}"' for key, value in entries)
    kind = "continuous" if link.hinge else "prismatic"
    limit = "" if link.hinge else '<limit lower="-1e6" upper="1e6" effort="0" velocity="0"/>'
    spring = ""
    if link.stiffness:
        spring = (
            f'\n<gazebo reference="{name}"><springStiffness>{link.stiffness!r}</springStiffness>'
            f"<springReference>{link.rest!r}</springReference></gazebo>"
        )
    return (
        f'<link name="body{index + 1}"><inertial><mass value="{link.mass!r}"/>'
        f'<origin xyz="{_words(link.centre)}" rpy="{_words(link.inertial_turn)}"/>'
        f"<inertia {inertia}/></inertial></link>\n"
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="body{index + 1}"/>'
        f'<origin xyz="{_words(link.position)}" rpy="{_words(link.turn)}"/>'
        f'<axis xyz="{_words(link.axis)}"/>{limit}<dynamics damping="{link.damping!r}"/></joint>'
        f"{spring}"
    )

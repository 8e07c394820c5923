"""Wrong models that must fail, and right models that must pass."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

from soak.corpus.baselines import ACCEPT
from soak.corpus.entry import (
    GATE,
    Build,
    CorpusEntry,
    append_text,
    chain_builds,
    replace_text,
    write_file,
)
from soak.corpus.sound import MJCF, MJCF_SIDECAR, SYSTEM, URDF_SIDECAR

ROOT = Path(__file__).parents[2]
_MJCF, _SIDECAR, _SYSTEM, _SPACE = "mujoco.xml", "mujoco.xml.toml", "system.py", "space.py"

_FALL = MJCF.replace(
    "<inertial", '<joint name="fall" type="slide" axis="0 0 1"/>\n      <inertial', 1
)
"""A model with one more degree of freedom than the system: the block falls."""

_LATE_DRAIN = """
    def drained(body, gravity, damping, dt):
        pymunk.Body.update_velocity(body, gravity, damping * (0.999 if dt == 0.002 else 1), dt)

    block.velocity_func = drained
"""

_TWO = (
    SYSTEM.replace("m = Constant", 'y = Coordinate("y", "m", "height")\nm = Constant', 1)
    .replace("coordinates=(x,)", "coordinates=(x, y)")
    .replace("x.v**2 / 2,\n    V", "(x.v**2 + y.v**2) / 2,\n    V", 1)
    .replace("V=k * x.q**2 / 2", "V=k * (x.q**2 + y.q**2) / 2")
    .replace("D=c * x.v**2 / 2", "D=c * (x.v**2 + y.v**2) / 2")
    .replace("{x: 0}, False", "{x: 0, y: 0}, False")
    .replace("q={x: 0.1}, v={x: 0.2}", "q={x: 0.1, y: 0}, v={x: 0.2, y: 0}")
)
"""A system with a second coordinate that no scenario moves."""

_STATIONARY = MJCF.replace(
    "<inertial",
    '<joint name="y" type="slide" axis="0 1 0" stiffness="47" damping="0.9"/><inertial',
    1,
)

_ROTOR = '''"""A rotor on a torsion spring."""

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System

theta = Coordinate("theta", "rad", "turn")
J = Constant("J", 2.0, "kg*m^2", "moment about the axis", "chosen")
k = Constant("k", 47.0, "N*m/rad", "stiffness", "chosen")
tau = Input("tau", "N*m", "torque", on={theta: 1})
system = System(
    name="rotor", title="Rotor", source="chosen", coordinates=(theta,), constants=(J, k),
    inputs=(tau,), outputs=(Output("theta", theta.q, "rad", "turn"),), T=J * theta.v**2 / 2,
    V=k * theta.q**2 / 2, D=0, equilibria=(Equilibrium("rest", {theta: 0}, False, "relaxed"),),
    scenarios=(Scenario("free", "released", q={theta: 1.0}, v={theta: 0}, inputs={tau: 0},
                        duration=2.0),),
    published=(),
)
'''
_TILTED = """<robot name="rotor"><link name="ground"/>
<link name="rotor"><inertial><mass value="1"/>
<inertia ixx="1.7" iyy="2.0" izz="1.3" ixy="0.31" ixz="0.17" iyz="0.11"/></inertial></link>
<joint name="theta" type="continuous"><parent link="ground"/><child link="rotor"/>
<axis xyz="0 1 0"/></joint>
<gazebo reference="theta"><springStiffness>47.0</springStiffness></gazebo></robot>
"""


def _delete_file(name: str) -> Build:
    return lambda workspace: (workspace / "hostile" / name).unlink()


_SPRING = "[[spring]]\njoints = {x = 1}\nstiffness = 1\ndamping = 0\nrest = 0\n"
_FORCE = "1.5 * sin(5.9 * t)"
_START = "    space = pymunk.Space()\n"
_OWN_STEP = """    class Own(pymunk.Space):
        def step(self, dt):
            super().step(dt)
            self.bodies[0].velocity *= 0.9999

    space = Own()
"""
_CLASS_STEP = """    plain = pymunk.Space.step

    def own(space, dt):
        plain(space, dt)
        space.bodies[0].velocity *= 0.9999

    pymunk.Space.step = own
"""
_STILL = "    block.position_func = lambda body, dt: None\n"
_EXACT = '"body[block]/inertial@diaginertia[0]" = "m"\n'
_STIFFER = replace_text(_MJCF, ('"47"', '"47.000047"'))


def _add_coordinates(lines: str) -> Build:
    added = replace_text(_SIDECAR, ("[bindings]", f"[coordinates]\n{lines}\n[bindings]"))
    return chain_builds(write_file(_MJCF, _FALL), added)


WRONG_MJCF: Mapping[str, Build] = {
    "a step longer than the motion": replace_text(_MJCF, ('"0.002"', '"3"')),
    "a step of 1e30 in the sidecar": append_text(_SIDECAR, "[settings]\nstep = 1e30\n"),
    "a binding beyond every list": append_text(_SIDECAR, f'"option@gravity[{"9" * 4400}]" = "m"\n'),
    "a binding that is a tower of powers": replace_text(_SIDECAR, ('"k"', '"m * 9**9**9"')),
    "a bound number that no motion feels": append_text(_SIDECAR, _EXACT),
    "a freedom too many": _add_coordinates('x = "x"\nfall = 0'),
    "a coordinate that follows without an equality": _add_coordinates('x = "x"\nfall = "x"'),
    "a stiffness wrong by 1e-6": _STIFFER,
    "a mass wrong by 1e-8": replace_text(_MJCF, ('"1.3"', '"1.300000013"')),
    "a complex force": replace_text(_SYSTEM, (_FORCE, f"(1 + 1j) * {_FORCE}")),
    "a complex share of a force": replace_text(_SYSTEM, ("on={x: 1}", "on={x: 1 + 1j}")),
    "a force that is complex for a while": replace_text(_SYSTEM, (_FORCE, "1.5 * (t - 0.5)**1.5")),
    "a spring beside an MJCF": append_text(_SIDECAR, _SPRING),
    "no engine that is there": replace_text(_SIDECAR, ('"mujoco"', '"havok"')),
    "another scenario than the model can do": replace_text(
        _SYSTEM, ("duration=1.0", "duration=1e-9")
    ),
}

WRONG_SPACES: Mapping[str, Build] = {
    "a space that steps otherwise": replace_text(_SPACE, (_START, _OWN_STEP)),
    "a drain at the shipped step alone": replace_text(
        _SPACE, ("    space.add(", f"{_LATE_DRAIN}    space.add(")
    ),
    "a step on the class": replace_text(_SPACE, (_START, _START + _CLASS_STEP)),
    "a position function": replace_text(_SPACE, ("    space.add(", f"{_STILL}    space.add(")),
    "a spring beside a space": append_text(f"{_SPACE}.toml", _SPRING),
}

GATED: Mapping[str, Build] = {
    "a stiffness wrong by 1e-6": _STIFFER,
    "a constant of the system": replace_text(_SYSTEM, ("47.0", "47.000047")),
    "a model file that is gone": _delete_file(_MJCF),
    "a sidecar that is gone": _delete_file(_SIDECAR),
    "the system that is gone": _delete_file(_SYSTEM),
    "an engine that is gone": replace_text(_SIDECAR, ('"mujoco"', '"havok"')),
    "a scenario that is gone": replace_text(_SYSTEM, ('"driven", "driven"', '"forced", "driven"')),
}
"""Changes that a gate must report after the unchanged folder was accepted."""


def verdict_entries() -> Iterator[CorpusEntry]:
    """Yield the wrong models that must fail and the right models that must pass."""
    for builds, model in ((WRONG_MJCF, _MJCF), (WRONG_SPACES, _SPACE)):
        for name, build in builds.items():
            yield CorpusEntry(f"wrong/{name}", build, model=model, codes=(1, 3))
    bound = append_text(_SIDECAR, '"body[block]/inertial@diaginertia[0]" = "m / 1.3"\n')
    heavier = chain_builds(bound, replace_text(_MJCF, ('"1 1 1"', '"2 2 2"')))
    gate = partial(CorpusEntry, before=(ACCEPT,), command=GATE)
    yield gate("gate/a bound number that no motion feels", heavier, codes=(1, 3))
    for name, build in GATED.items():
        yield gate(f"gate/{name}", build, codes=(1, 2, 3))
    yield from _right_entries()


def _right_entries() -> Iterator[CorpusEntry]:
    right = partial(CorpusEntry, codes=(0,))
    stands = chain_builds(
        write_file(_SYSTEM, _TWO),
        write_file(_MJCF, _STATIONARY),
        write_file(_SIDECAR, MJCF_SIDECAR),
    )
    yield right("right/a coordinate that nothing moves", stands)
    order = 'stiffness="47" damping="0.9"', 'damping="0.9" stiffness="47"'
    for name, old, new in (
        ("comments everywhere", "<worldbody>", "<!-- <worldbody> --><worldbody>"),
        ("another order of attributes", *order),
        ("numbers written otherwise", '"47"', '"4.70e+1"'),
        ("a name with a space", 'name="block"', 'name="the block"'),
        ("a name in another script", 'name="block"', 'name="Tr\u00e4gheit"'),
    ):
        build = replace_text(_MJCF, (old, new))
        if "block" in old:
            renamed = new.partition('"')[2].rstrip('"')
            build = chain_builds(build, replace_text(_SIDECAR, ("body[block]", f"body[{renamed}]")))
        yield right(f"right/{name}", build)
    for engine in ("pybullet", "mujoco"):
        rotor = chain_builds(
            write_file(_SYSTEM, _ROTOR),
            write_file("robot.urdf", _TILTED),
            write_file("robot.urdf.toml", URDF_SIDECAR.partition("[bindings]")[0].replace(
                '["pybullet", "mujoco"]', f'["{engine}"]').replace(
                '[settings.mujoco]\nintegrator = "Euler"\n', "")),
        )  # fmt: skip
        yield right(f"right/products of inertia in {engine}", rotor, model="robot.urdf")
    yield right("right/chaos", _write_chaotic_folder, slow=True)


def _write_chaotic_folder(workspace: Path) -> None:
    """Write a double pendulum released nearly upright that runs until no digit is accurate."""
    shutil.rmtree(workspace / "hostile")
    model = ROOT / "tests" / "installed" / "repository" / "models" / "double_pendulum"
    (workspace / "hostile").mkdir()
    for name in (_SYSTEM, _MJCF, _SIDECAR):
        text = (model / name).read_text("utf-8").replace("duration=6.0", "duration=25.0", 1)
        (workspace / "hostile" / name).write_text(text, "utf-8")

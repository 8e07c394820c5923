"""Wrong models that must not pass, and right ones that must."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from soak.corpus.baselines import ACCEPT
from soak.corpus.entry import Build, Entry, added, both, replaced, written
from soak.corpus.sound import MJCF, MJCF_SIDECAR, SYSTEM, URDF_SIDECAR

ROOT = Path(__file__).parents[2]
_GATE = ("gate", "@hostile", "--baseline", "@baseline", "--out", "@og", "--jobs", "1")
_MJCF, _SIDECAR, _SYSTEM = "mujoco.xml", "mujoco.xml.toml", "system.py"

_FALL = MJCF.replace(
    "<inertial", '<joint name="fall" type="slide" axis="0 0 1"/>\n      <inertial', 1
)
"""One freedom more than the system has: the block falls."""

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
"""A second coordinate that no scenario moves."""

_STANDS = MJCF.replace(
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


def verdicts() -> Iterator[Entry]:
    """Every wrong model that must fail, and every right one that must pass."""
    yield from _wrong()
    yield from _gated()
    yield from _right()


def _wrong() -> Iterator[Entry]:
    for name, build, model in (
        ("a step longer than the motion", replaced(_MJCF, ('"0.002"', '"3"')), _MJCF),
        ("a step of 1e30 in the sidecar", added(_SIDECAR, "[settings]\nstep = 1e30\n"), _MJCF),
        ("a binding beyond every list",
         added(_SIDECAR, f'"option@gravity[{"9" * 4400}]" = "m"\n'), _MJCF),
        ("a binding that is a tower of powers",
         replaced(_SIDECAR, ('"k"', '"m * 9**9**9"')), _MJCF),
        ("a bound number that no motion feels",
         both(added(_SIDECAR, '"body[block]/inertial@diaginertia[0]" = "m"\n')), _MJCF),
        ("a freedom too many",
         both(written(_MJCF, _FALL), _coordinates('x = "x"\nfall = 0')), _MJCF),
        ("a coordinate that follows without an equality",
         both(written(_MJCF, _FALL), _coordinates('x = "x"\nfall = "x"')), _MJCF),
        ("a stiffness wrong by 1e-6", replaced(_MJCF, ('"47"', '"47.000047"')), _MJCF),
        ("a mass wrong by 1e-8", replaced(_MJCF, ('"1.3"', '"1.300000013"')), _MJCF),
        ("a complex force",
         replaced(_SYSTEM, ("1.5 * sin(5.9 * t)", "(1 + 1j) * 1.5 * sin(5.9 * t)")), _MJCF),
        ("a space that steps otherwise", replaced("space.py", (
            "space = pymunk.Space()",
            "class Own(pymunk.Space):\n        def step(self, dt):\n"
            "            super().step(dt)\n            self.bodies[0].velocity *= 0.9999\n\n"
            "    space = Own()")), "space.py"),
        ("a drain at the shipped step alone",
         replaced("space.py", ("    space.add(", f"{_LATE_DRAIN}    space.add(")), "space.py"),
        ("a complex share of a force", replaced(_SYSTEM, ("on={x: 1}", "on={x: 1 + 1j}")), _MJCF),
        ("a force that is complex for a while",
         replaced(_SYSTEM, ("1.5 * sin(5.9 * t)", "1.5 * (t - 0.5)**1.5")), _MJCF),
        ("a step on the class", replaced("space.py", (
            "    space = pymunk.Space()\n",
            "    space = pymunk.Space()\n    plain = pymunk.Space.step\n\n"
            "    def own(space, dt):\n        plain(space, dt)\n"
            "        space.bodies[0].velocity *= 0.9999\n\n    pymunk.Space.step = own\n")),
         "space.py"),
        ("a position function", replaced("space.py", (
            "    space.add(", "    block.position_func = lambda body, dt: None\n    space.add(")),
         "space.py"),
        ("a spring beside a space",
         added("space.py.toml",
               "[[spring]]\njoints = {x = 1}\nstiffness = 1\ndamping = 0\nrest = 0\n"),
         "space.py"),
        ("a spring beside an MJCF",
         added(_SIDECAR, "[[spring]]\njoints = {x = 1}\nstiffness = 1\ndamping = 0\nrest = 0\n"),
         _MJCF),
        ("no engine that is there", replaced(_SIDECAR, ('"mujoco"', '"havok"')), _MJCF),
        ("another scenario than the model can do",
         replaced(_SYSTEM, ("duration=1.0", "duration=1e-9")), _MJCF),
    ):  # fmt: skip
        yield Entry(name=f"wrong/{name}", build=build, model=model, codes=(1, 3))


def _coordinates(lines: str) -> Build:
    return replaced(_SIDECAR, ("[bindings]", f"[coordinates]\n{lines}\n[bindings]"))


def _gated() -> Iterator[Entry]:
    """What a gate must see: each was accepted as it was before."""
    inertia = '"body[block]/inertial@diaginertia[0]" = "m / 1.3"\n'

    def bound(place: Path) -> None:
        path = place / "hostile" / _SIDECAR
        path.write_text(path.read_text("utf-8") + inertia, "utf-8")

    yield Entry(name="gate/a bound number that no motion feels",
                build=both(bound, replaced(_MJCF, ('"1 1 1"', '"2 2 2"'))), before=(ACCEPT,),
                command=_GATE, codes=(1, 3))  # fmt: skip
    for name, build in (
        ("a stiffness wrong by 1e-6", replaced(_MJCF, ('"47"', '"47.000047"'))),
        ("a constant of the system", replaced(_SYSTEM, ("47.0", "47.000047"))),
        ("a model file that is gone", _gone(_MJCF)),
        ("a sidecar that is gone", _gone(_SIDECAR)),
        ("the system that is gone", _gone(_SYSTEM)),
        ("an engine that is gone", replaced(_SIDECAR, ('"mujoco"', '"havok"'))),
        (
            "a scenario that is gone",
            replaced(_SYSTEM, ('"driven", "driven"', '"forced", "driven"')),
        ),
    ):
        yield Entry(name=f"gate/{name}", build=build, before=(ACCEPT,), command=_GATE,
                    codes=(1, 2, 3))  # fmt: skip


def _gone(name: str) -> Build:
    return lambda place: (place / "hostile" / name).unlink()


def _right() -> Iterator[Entry]:
    stands = both(written(_SYSTEM, _TWO), written(_MJCF, _STANDS), written(_SIDECAR, MJCF_SIDECAR))
    yield Entry(name="right/a coordinate that nothing moves", build=stands, codes=(0,))
    for name, old, new in (
        ("comments everywhere", "<worldbody>", "<!-- <worldbody> --><worldbody>"),
        (
            "another order of attributes",
            'stiffness="47" damping="0.9"',
            'damping="0.9" stiffness="47"',
        ),
        ("numbers written otherwise", '"47"', '"4.70e+1"'),
        ("a name with a space", 'name="block"', 'name="the block"'),
        ("a name in another script", 'name="block"', 'name="Tr\u00e4gheit"'),
    ):
        build = replaced(_MJCF, (old, new))
        if "block" in old:
            renamed = new.partition('"')[2].rstrip('"')
            build = both(build, replaced(_SIDECAR, ("body[block]", f"body[{renamed}]")))
        yield Entry(name=f"right/{name}", build=build, codes=(0,))
    for engine in ("pybullet", "mujoco"):
        rotor = both(
            written(_SYSTEM, _ROTOR),
            written("robot.urdf", _TILTED),
            written("robot.urdf.toml", URDF_SIDECAR.partition("[bindings]")[0].replace(
                '["pybullet", "mujoco"]', f'["{engine}"]').replace(
                '[settings.mujoco]\nintegrator = "Euler"\n', "")),
        )  # fmt: skip
        yield Entry(name=f"right/products of inertia in {engine}", build=rotor, model="robot.urdf",
                    codes=(0,))  # fmt: skip
    yield Entry(name="right/chaos", build=_chaos, codes=(0,), slow=True)


def _chaos(place: Path) -> None:
    """A double pendulum let go from nearly upright, for so long that no digit is left."""
    shutil.rmtree(place / "hostile")
    model = ROOT / "tests" / "installed" / "repository" / "models" / "double_pendulum"
    (place / "hostile").mkdir()
    for name in (_SYSTEM, _MJCF, _SIDECAR):
        text = (model / name).read_text("utf-8").replace("duration=6.0", "duration=25.0", 1)
        (place / "hostile" / name).write_text(text, "utf-8")

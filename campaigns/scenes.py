"""Whole steps of random scenes, compared with the law of their engine.

`python -m campaigns.scenes mujoco --count 2000` draws bodies on a plane and on each other, with an
arm at its limits; `mjx` draws the same. `pybullet`, `drake` and `mujoco-urdf` draw URDFs on a
floor, `pymunk` bodies in a plane. A law is correct if no error exceeds its uncertainty, also if
MuJoCo's solver stops early.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from campaigns.laws import RESOLUTION, spec_of
from physics_crosscheck.harness.checks.law_comparison import Evaluated, LawComparison, LawDefect
from physics_crosscheck.harness.checks.law_states import evaluated_states
from physics_crosscheck.harness.checks.planar_step import check_planar_step
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.engines.mujoco.whole import MujocoWhole
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, law_model
from physics_crosscheck.harness.records.outcome import Outcome

OWN_SOLVER = "solver", "tolerance", "iterations", "ls_iterations", "ls_tolerance"
"""Options of a scene that set up its own solver."""


@dataclass(frozen=True, kw_only=True)
class SceneResult:
    """The comparison of one scene.

    Attributes:
        outcome: of whole steps.
        ratios: largest error over its uncertainty, by solver.
        discrepancy: largest relative error.
        acted: number of times that forces of each kind acted.
        reason: component and uncertainty of the judgement, or parts without a law.
    """

    outcome: str
    ratios: Mapping[str, float]
    discrepancy: float
    acted: Counter[str]
    reason: str = ""


def largest_ratio(compared: LawDefect) -> float:
    """Return the largest error over its uncertainty."""
    bound = np.maximum(compared.uncertainty, np.finfo(float).eps)
    return float(np.max(np.abs(compared.defect) / bound))


def mujoco_result(file: Path, engine: str = "mujoco") -> SceneResult:
    """Compare a scene with the law, solved exactly and by MuJoCo's own solver."""
    reader = compiler(file.suffix)
    assert reader is not None
    laws = law_model(reader.compiled(file))
    assert laws is not None
    model = engines()[engine].load_whole(ModelSpec(file))
    assert model is not None
    comparison = LawComparison(laws, model)
    evaluated = evaluated_states(comparison)
    compared = comparison.compare(evaluated)
    judged = comparison.judge(compared, RESOLUTION)
    acted = Counter[str]()
    for sample in evaluated:
        acted.update(dict(sample.solution.law.acted(sample.acceleration)))
    ratios = {"exact": largest_ratio(compared)}
    if engine == "mujoco":
        ratios["own"] = largest_ratio(by_own_solver(comparison, evaluated))
    return SceneResult(
        outcome=str(judged.outcome),
        ratios=ratios,
        discrepancy=judged.largest_discrepancy,
        acted=acted,
        reason=f"{comparison.components[judged.component]} U {judged.largest_uncertainty:.1e}",
    )


def mjx_result(file: Path) -> SceneResult:
    """Compare a scene in MJX with MuJoCo's law."""
    return mujoco_result(file, "mjx")


def by_own_solver(comparison: LawComparison, evaluated: Sequence[Evaluated]) -> LawDefect:
    """Compare the states again, with the solver and tolerance of the file."""
    model = comparison.model
    assert isinstance(model, MujocoWhole)
    exact = model.solver
    model.solver = {**exact, **{name: model.shipped[name] for name in OWN_SOLVER}}
    stepped = [replace(sample, engine=model.evaluate(sample.state)) for sample in evaluated]
    model.solver = exact
    return comparison.compare(stepped)


def impulse_result(file: Path) -> SceneResult:
    """Compare a scene of PyBullet or pymunk, whose laws are impulses."""
    if file.suffix == ".py":
        spec = ModelSpec(file, settings={"step": 0.004})
        return scene_result(check_planar_step(spec, spec, "pymunk", RESOLUTION))
    engine, spec = spec_of(file, floating=True)
    return scene_result(check_whole_step(file, spec, engine, RESOLUTION))


def urdf_result(file: Path, engine: str) -> SceneResult:
    """Compare a scene in an engine: on a floor, or with a fixed root at a longer step."""
    floating = "<collision>" in file.read_text().partition("</link>")[0]
    engine, spec = spec_of(file, engine, floating=floating)
    spec = replace(spec, settings={**spec.settings, "step": 0.001 if floating else 0.005})
    return scene_result(check_whole_step(file, spec, engine, RESOLUTION))


def scene_result(check: WholeStepCheck | None) -> SceneResult:
    """Return the result of whole steps."""
    assert check is not None
    record, judged = check.record, check.judgement
    if judged is None:
        return SceneResult(outcome="not compared", ratios={}, discrepancy=0.0, acted=Counter(),
                           reason=", ".join(record.uncovered))  # fmt: skip
    return SceneResult(
        outcome=str(judged.outcome),
        ratios={"exact": judged.discrepancy / judged.uncertainty},
        discrepancy=judged.largest_discrepancy,
        acted=Counter({term.name: term.count for term in record.acted}),
        reason=f"{record.component} U {judged.largest_uncertainty:.1e}",
    )


class SceneDraw:
    """A source of random numbers and elements of a scene, as texts.

    Args:
        rng: source of all draws.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def number(self, low: float, high: float) -> str:
        """Return a random number between two bounds."""
        return f"{self.rng.uniform(low, high):.6g}"

    def numbers(self, low: float, high: float, count: int) -> str:
        """Return random numbers between two bounds, separated by spaces."""
        return " ".join(self.number(low, high) for _ in range(count))

    def pick(self, *values: object) -> object:
        """Return a random one of the values."""
        return values[int(self.rng.integers(len(values)))]

    def softness(self, kind: str = "") -> str:
        """Return random `solref` and `solimp`, in either format of `solref`."""
        direct = self.rng.uniform() < 0.3
        reference = (
            f"{self.number(-3000, -200)} {self.number(-80, -5)}"
            if direct
            else f"{self.number(0.004, 0.1)} {self.number(0.3, 1.5)}"
        )
        low, high = np.sort(self.rng.uniform(0.1, 0.99, 2))
        shape = f"{self.number(0, 0.02)} {self.number(0.1, 0.9)} {self.number(1, 4)}"
        return f'solref{kind}="{reference}" solimp{kind}="{low:.6g} {high:.6g} {shape}"'

    def surface(self) -> str:
        """Return the contact attributes of a shape."""
        friction = f"{self.number(0, 1.2)} {self.number(0, 0.05)} {self.number(0, 0.02)}"
        margin = self.pick("0", self.number(0, 0.003))
        gap = self.pick("0", "0", self.number(0, 0.001))
        return (
            f'condim="{self.pick(1, 3, 4, 6)}" friction="{friction}" margin="{margin}" gap="{gap}"'
            f' priority="{self.pick(0, 0, 0, 1)}" solmix="{self.number(0, 3)}" {self.softness()}'
        )

    def body(self, k: int) -> str:
        """Return a free body, on the plane or above others."""
        kind = self.pick("sphere", "box", "capsule")
        size = self.rng.uniform(0.04, 0.12, {"sphere": 1, "box": 3, "capsule": 2}[str(kind)])
        height = size.sum() if kind == "capsule" else size[-1]
        x, y = self.rng.uniform(-0.15, 0.15, 2)
        z = height + 0.15 * (k // 2) - self.rng.uniform(0, 0.004)
        shape = " ".join(f"{one:.6g}" for one in size)
        return (
            f'<body pos="{x:.6g} {y:.6g} {z:.6g}"><freejoint/><geom type="{kind}" size="{shape}"'
            f' mass="{self.number(0.2, 3)}" {self.surface()}/></body>'
        )

    def arm(self) -> str:
        """Return an arm of up to three links at its limits, with dry friction and a ball joint."""
        text = ""
        for name in "cba"[int(self.rng.integers(3)) :]:
            place = "0.6 0 0.3" if name == "a" else "0.2 0 0"
            kind = "ball" if name == "c" and self.rng.uniform() < 0.5 else "hinge"
            low = "0" if kind == "ball" else self.number(-30, 0)
            text = (
                f'<body pos="{place}"><joint name="{name}" type="{kind}"'
                f' axis="0 1 {self.pick(0, 1)}" range="{low} {self.number(1, 40)}"'
                f' margin="{self.pick(0, self.number(0, 0.05))}"'
                f' frictionloss="{self.pick(0, self.number(0, 1))}" damping="{self.number(0, 1)}"'
                f' armature="{self.pick(0, self.number(0, 0.1))}" {self.softness("limit")}'
                f" {self.softness('friction')}/>"
                f'<geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.03" mass="1"'
                f" {self.surface()}/>{text}</body>"
            )
        return text

    def options(self) -> str:
        """Return the time step, integrator, friction cone, and settings of the solver."""
        return (
            f'timestep="{self.pick(0.001, 0.002, 0.005)}"'
            f' integrator="{self.pick("Euler", "implicitfast", "implicit")}"'
            f' cone="{self.pick("pyramidal", "elliptic")}" impratio="{self.pick(1, 1, 3, 10)}"'
            f' solver="{self.pick("Newton", "CG")}" iterations="{self.pick(1, 2, 5, 20, 100)}"'
            f' tolerance="1e-{self.pick(2, 4, 6, 8, 12)}" ls_iterations="{self.pick(3, 10, 50)}"'
            f' ls_tolerance="{self.pick(0.1, 0.01, 0.001)}"'
        )


def mujoco_scene(rng: np.random.Generator) -> str:
    """Draw an MJCF: bodies on a plane and on each other, and an arm at its limits."""
    draw = SceneDraw(rng)
    bodies = "".join(draw.body(k) for k in range(int(rng.integers(1, 5))))
    servo = (
        f'<position joint="a" kp="{draw.number(5, 80)}" kv="{draw.number(0, 5)}"'
        f' forcerange="-{draw.number(1, 9)} 5" ctrlrange="-1 1"/>'
    )
    return (
        f"<mujoco><option {draw.options()}/><worldbody>"
        f'<geom type="plane" size="5 5 .1" {draw.surface()}/>{bodies}{draw.arm()}</worldbody>'
        f"<actuator>{servo}</actuator></mujoco>"
    )


def mjx_scene(rng: np.random.Generator) -> str:
    """Draw an MJCF without the integrator and the contacts that MJX refuses."""
    text = mujoco_scene(rng).replace('integrator="implicit"', 'integrator="implicitfast"')
    return text.replace('condim="1"', 'condim="3"') if 'cone="elliptic"' in text else text


def pybullet_scene(rng: np.random.Generator) -> str:
    """Draw a URDF for a floor: a sphere, box or capsule, with up to three limbs."""
    draw = SceneDraw(rng)
    links, joints = [_link(draw, "base")], []
    for k in range(int(rng.integers(0, 4))):
        parent = "base" if k < 2 else f"limb{k - 2}"
        kind = draw.pick("revolute", "prismatic", "continuous")
        links.append(_link(draw, f"limb{k}"))
        joints.append(
            f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/><child link="limb{k}"/>'
            f'<origin xyz="{draw.numbers(-0.3, 0.3, 3)}" rpy="{draw.numbers(-1, 1, 3)}"/>'
            f'<axis xyz="{draw.pick("1 0 0", "0 1 0", "0 0 1")}"/>'
            f'<limit lower="{draw.number(-0.4, 0)}" upper="{draw.number(0.01, 0.4)}"'
            f' effort="{draw.pick(0, draw.number(0, 20))}" velocity="10"/></joint>'
        )
    return f'<robot name="scene">{"".join(links)}{"".join(joints)}</robot>'


def _link(draw: SceneDraw, name: str) -> str:
    shape = draw.pick(
        f'<sphere radius="{draw.number(0.04, 0.1)}"/>',
        f'<box size="{draw.numbers(0.08, 0.2, 3)}"/>',
        f'<capsule radius="{draw.number(0.03, 0.06)}" length="{draw.number(0.05, 0.2)}"/>',
    )
    extra = draw.pick(
        "", f'<restitution value="{draw.number(0, 1)}"/>',
        f'<stiffness value="{draw.number(500, 5000)}"/><damping value="{draw.number(1, 30)}"/>',
        '<friction_anchor/>',
    )  # fmt: skip
    moments = draw.rng.uniform(0.004, 0.006, 3)
    inertia = " ".join(
        f'{key}="{value:.6g}"' for key, value in zip(("ixx", "iyy", "izz"), moments, strict=True)
    )
    return (
        f'<link name="{name}"><contact><lateral_friction value="{draw.number(0, 1.2)}"/>{extra}'
        f"</contact><inertial>"
        f'<origin xyz="{draw.numbers(-0.02, 0.02, 3)}"/><mass value="{draw.number(0.3, 3)}"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial>'
        f"<collision><geometry>{shape}</geometry></collision></link>"
    )


def urdf_scene(rng: np.random.Generator) -> str:
    """Draw a URDF: a body with shapes for a floor, or a fixed one without, and links on it."""
    draw = SceneDraw(rng)
    count, joints = int(rng.integers(1, 7)), []
    shapes = [0 if rng.uniform() < 0.15 else int(rng.integers(1, 3))]
    shapes += [int(rng.integers(0, 3)) for _ in range(1, count)]
    for k in range(1, count):
        axis = " ".join(f"{one:.6g}" for one in rng.normal(size=3))
        kind = draw.pick("revolute", "prismatic", "continuous", "fixed")
        joints.append(
            f'<joint name="j{k}" type="{kind}">'
            f'<parent link="l{rng.integers(k)}"/><child link="l{k}"/>'
            f'<origin xyz="{draw.numbers(-0.3, 0.3, 3)}" rpy="{draw.numbers(-1, 1, 3)}"/>'
            f'<axis xyz="{axis}"/><dynamics damping="{draw.pick(0, draw.number(0, 1))}"'
            f' friction="{draw.pick(0, draw.number(0, 1))}"/>'
            f'<limit lower="{draw.number(-1, -0.01)}" upper="{draw.number(0.01, 1)}"'
            ' effort="5" velocity="5"/></joint>'
        )
    links = "".join(
        f'<link name="l{k}">{_turned_inertia(draw)}'
        f"{''.join(_urdf_shape(draw) for _ in range(drawn))}</link>"
        for k, drawn in enumerate(shapes)
    )
    uri = "http://drake.mit.edu"
    return f'<robot name="scene" xmlns:drake="{uri}">{links}{"".join(joints)}</robot>'


def _turned_inertia(draw: SceneDraw) -> str:
    mass = 10 ** draw.rng.uniform(-1, 1)
    a, b, c = draw.rng.uniform(0.003, 0.03, 3)
    moments = {"ixx": b + c, "iyy": a + c, "izz": a + b}
    inertia = " ".join(f'{key}="{mass * value:.6g}"' for key, value in moments.items())
    return (
        f'<inertial><origin xyz="{draw.numbers(-0.05, 0.05, 3)}" rpy="{draw.numbers(-1, 1, 3)}"/>'
        f'<mass value="{mass:.6g}"/><inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _urdf_shape(draw: SceneDraw) -> str:
    shape = draw.pick(
        f'<box size="{draw.numbers(0.05, 0.3, 3)}"/>',
        f'<sphere radius="{draw.number(0.03, 0.15)}"/>',
        f'<cylinder radius="{draw.number(0.03, 0.1)}" length="{draw.number(0.05, 0.3)}"/>',
    )
    friction = draw.number(0.05, 1.2)
    surface = "".join(
        str(draw.pick("", text))
        for text in (
            f'<drake:mu_dynamic value="{friction}"/><drake:mu_static value="{friction}"/>',
            f'<drake:point_contact_stiffness value="{10 ** draw.rng.uniform(3, 7):.6g}"/>',
            f'<drake:hunt_crossley_dissipation value="{draw.pick(0, draw.number(0, 100))}"/>',
        )
    )
    return (
        f'<collision><origin xyz="{draw.numbers(-0.1, 0.1, 3)}" rpy="{draw.numbers(-3, 3, 3)}"/>'
        f"<geometry>{shape}</geometry><drake:proximity_properties>{surface}"
        "</drake:proximity_properties></collision>"
    )


def pymunk_scene(rng: np.random.Generator) -> str:
    """Draw a Space: circles, boxes and segments on a floor, with joints between them."""
    draw = SceneDraw(rng)
    lines = [
        "space = pymunk.Space()",
        f"space.gravity = ({draw.number(-1, 1)}, -9.81)",
        f"space.damping = {draw.pick(1, draw.number(0.5, 1))}",
        f"space.iterations = {draw.pick(1, 5, 10, 30)}",
        f"space.collision_slop = {draw.pick(0.1, draw.number(0, 0.01))}",
        f"space.collision_bias = {draw.pick(0.9**60, draw.number(0, 0.1))}",
        "ground = space.static_body",
        f"shapes = [pymunk.Segment(ground, (-3, 0), (3, {draw.number(-0.2, 0.2)}), 0.02)]",
        "bodies = {}",
    ]
    for k in range(int(rng.integers(1, 5))):
        center = draw.pick("0, 0", draw.numbers(-0.02, 0.02, 2).replace(" ", ", "))
        x, height = draw.number(-0.4, 0.4), 0.15 + 0.25 * k
        size = draw.numbers(0.1, 0.3, 2).replace(" ", ", ")
        shape = draw.pick(
            f"pymunk.Circle(bodies['b{k}'], {draw.number(0.05, 0.15)}, ({center}))",
            f"pymunk.Poly.create_box(bodies['b{k}'], ({size}), {draw.pick(0, 0.01)})",
            f"pymunk.Segment(bodies['b{k}'], (-0.1, 0), ({size}), 0.03)",
        )
        lines += [
            f"bodies['b{k}'] = pymunk.Body({draw.number(0.2, 3)}, {draw.number(0.005, 0.05)})",
            f"bodies['b{k}'].position = {x}, {height}",
            f"bodies['b{k}'].center_of_gravity = {center}",
            f"shapes.append({shape})",
        ]
        if rng.uniform() < 0.6:
            other = f"bodies['b{int(rng.integers(k))}']" if k else "space.static_body"
            lines += _pymunk_joint(draw, other, f"bodies['b{k}']")
    lines += [
        "for shape in shapes:",
        f"    shape.friction, shape.elasticity = {draw.number(0, 1.2)}, {draw.number(0, 1)}",
        "shapes[-1].surface_velocity = (0.2, 0)",
        "space.add(*bodies.values(), *shapes)",
        "return space, bodies",
    ]
    return "import pymunk\n\ndef build():\n" + "".join(f"    {line}\n" for line in lines)


def _pymunk_joint(draw: SceneDraw, first: str, other: str) -> list[str]:
    ends = f"({draw.number(-0.1, 0.1)}, 0.1), (0, {draw.number(-0.1, 0.1)})"
    numbers = f"{draw.number(-1, 0)}, {draw.number(0.1, 1)}"
    spring = f"{draw.number(0.1, 0.5)}, {draw.number(1, 50)}, {draw.number(0, 2)}"
    kind = draw.pick(
        f"PinJoint({first}, {other}, {ends})", f"PivotJoint({first}, {other}, {ends})",
        f"SlideJoint({first}, {other}, {ends}, 0.05, {draw.number(0.1, 0.5)})",
        f"RotaryLimitJoint({first}, {other}, {numbers})",
        f"GearJoint({first}, {other}, {numbers})",
        f"SimpleMotor({first}, {other}, {draw.number(-3, 3)})",
        f"GrooveJoint({first}, {other}, (-0.2, 0), (0.2, 0.1), (0, 0.05))",
        f"DampedSpring({first}, {other}, {ends}, {spring})",
        f"DampedRotarySpring({first}, {other}, {spring})",
    )  # fmt: skip
    return [
        f"joint = pymunk.{kind}",
        f"joint.max_force = {draw.pick('1e9', draw.number(0.1, 30))}",
        f"joint.error_bias = {draw.pick(0.9**60, draw.number(0, 0.1))}",
        f"joint.max_bias = {draw.pick('1e9', draw.number(0.01, 1))}",
        "space.add(joint)",
    ]


Draw = Callable[[np.random.Generator], str]
Compare = Callable[[Path], SceneResult]
ENGINES: Mapping[str, tuple[str, Draw, Compare]] = {
    "mujoco": (".xml", mujoco_scene, mujoco_result),
    "mjx": (".xml", mjx_scene, mjx_result),
    "pybullet": (".urdf", pybullet_scene, impulse_result),
    "drake": (".urdf", urdf_scene, partial(urdf_result, engine="drake")),
    "mujoco-urdf": (".urdf", urdf_scene, partial(urdf_result, engine="mujoco")),
    "pymunk": (".py", pymunk_scene, impulse_result),
}
"""File suffix, draw and comparison of scenes by engine."""


def scenes(engine: str, count: int, seed: int) -> Counter[str]:
    """Compare random scenes; print those that do not agree, and the largest errors."""
    suffix, draw, compare = ENGINES[engine]
    rng, counts, acted = np.random.default_rng(seed), Counter[str](), Counter[str]()
    ratios, largest = dict[str, float](), 0.0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"scene{suffix}"
        for k in range(count):
            file.write_text(draw(rng))
            result = compare(file)
            counts[result.outcome] += 1
            acted.update(result.acted)
            largest = max(largest, result.discrepancy)
            beyond = [solver for solver, ratio in result.ratios.items() if ratio > 1]
            for solver, ratio in result.ratios.items():
                ratios[solver] = max(ratios.get(solver, 0.0), ratio)
            if beyond or result.outcome != Outcome.AGREES:
                print(k, result.outcome, dict(result.ratios), result.reason, flush=True)
            if beyond:
                Path(f"{engine}-{seed}-{k}{suffix}").write_text(file.read_text())
            if (k + 1) % 100 == 0:
                print(k + 1, dict(counts), f"largest E {largest:.1e}, E/U {ratios}", flush=True)
    print(f"largest E {largest:.1e}, largest E/U {ratios}; acted {dict(acted)}")
    return counts


def main() -> None:
    """Compare random scenes of an engine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("engine", choices=tuple(ENGINES))
    parser.add_argument("--count", type=int, default=200, help="scenes [200]")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(dict(scenes(options.engine, options.count, options.seed)))


if __name__ == "__main__":
    main()

"""Small mechanisms, each written for every pairing of adapter and format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_crosscheck.engine import Array, LoadedModel, ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import engines

Values = Array | Sequence[object]
"""Numbers as an array, or as nested lists."""

STEP = 0.004
"""The time step of every file here."""

MASS, STIFFNESS, DAMPING = 2.0, 50.0, 1.5
OTHER_MASS, COUPLING, DRAG = 0.7, 30.0, 0.4
LENGTH, GRAVITY = 0.5, 9.81
GAP = 3.0


@dataclass(frozen=True)
class Pairing:
    """An adapter on a format, with the coordinates of the mechanism."""

    engine: str
    format: str
    integrator: str | None = None

    def __str__(self) -> str:
        return " ".join(filter(None, (self.engine, self.format, self.integrator)))

    def spec(self, mechanism: str, folder: Path) -> ModelSpec:
        """Write the mechanism's file."""
        return _WRITERS[self.format](self, mechanism, folder)[0]

    def load(self, mechanism: str, folder: Path) -> Loaded:
        """Write the mechanism's file and load it; returns a `Loaded`."""
        spec, places = _WRITERS[self.format](self, mechanism, folder)
        return Loaded(engines()[self.engine].load(spec), np.array(places))


@dataclass(frozen=True)
class Loaded:
    """A model with the indices of the mechanism's coordinates in the engine."""

    model: LoadedModel
    places: Array

    @property
    def size(self) -> int:
        return len(self.model.coordinates)

    def lift(self, values: Values, origin: bool = True) -> Array:
        """Map the mechanism's coordinates, (..., n), to the engine's, (..., nz)."""
        values = np.asarray(values, dtype=float)
        full = np.zeros((*values.shape[:-1], self.size))
        full[..., self.places] = values
        if origin and self.size > len(self.places):
            # pymunk's second mass starts beyond the first.
            full[..., self.places] += GAP * np.arange(len(self.places))
        return full

    def run(
        self,
        q: Values,
        v: Values,
        h: float,
        n: int,
        force: Values | None = None,
        every: int | None = None,
    ) -> tuple[Array, Array]:
        """Return a rollout in the mechanism's coordinates, samples (B, S, n)."""
        lifted = None if force is None else self.lift(force, origin=False)
        q, v = self.lift(q), self.lift(v, origin=False)
        zs, ws = self.model.rollout(q, v, h, n, lifted, every or n)
        zs = zs[..., self.places]
        if self.size > len(self.places):
            zs = zs - GAP * np.arange(len(self.places))
        return zs, ws[..., self.places]


# Each mechanism: masses, ground springs, ground dampers, (coupling spring, coupling damper).
MECHANISMS = {
    "free mass": ((MASS,), (0.0,), (0.0,), None),
    "oscillator": ((MASS,), (STIFFNESS,), (DAMPING,), None),
    "pair": ((MASS, OTHER_MASS), (STIFFNESS, 0.0), (0.0, 0.0), (COUPLING, DRAG)),
}


def matrices(mechanism: str) -> tuple[Array, Array, Array]:
    """Return M, C and K of a mechanism."""
    m, k, c, pair = MECHANISMS[mechanism]
    join = np.array([[1.0, -1.0], [-1.0, 1.0]]) if pair else np.zeros((len(m), len(m)))
    stiffness, damping = pair or (0.0, 0.0)
    return np.diag(m), np.diag(c) + damping * join, np.diag(k) + stiffness * join


def _mjcf(pairing: Pairing, mechanism: str, folder: Path) -> tuple[ModelSpec, list[int]]:
    path = folder / "model.xml"
    option = f'<option timestep="{STEP}" integrator="{pairing.integrator}" jacobian="dense"/>'
    if mechanism == "pendulum":
        bodies = (
            '<body><joint name="q1" type="hinge" axis="0 -1 0"/><inertial'
            f' pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/></body>'
        )
        path.write_text(f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>")
        return ModelSpec(path), [0]
    m, k, c, pair = MECHANISMS[mechanism]
    bodies = "".join(
        f'<body><joint name="q{i}" type="slide" axis="1 0 0" stiffness="{ki}" damping="{ci}"/>'
        f'<inertial pos="0 0 0" mass="{mi}" diaginertia="1 1 1"/></body>'
        for i, (mi, ki, ci) in enumerate(zip(m, k, c, strict=True), start=1)
    )
    tendon = ""
    if pair:
        tendon = (
            f'<tendon><fixed stiffness="{pair[0]}" damping="{pair[1]}" springlength="0">'
            '<joint joint="q1" coef="-1"/><joint joint="q2" coef="1"/></fixed></tendon>'
        )
    path.write_text(f"<mujoco>{option}<worldbody>{bodies}</worldbody>{tendon}</mujoco>")
    return ModelSpec(path), list(range(len(m)))


INERTIA = '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/>'
GROUND = f'<link name="ground"><inertial><mass value="1"/>{INERTIA}</inertial></link>'


def link(name: str, mass: float, down: float = 0.0) -> str:
    """Return a URDF link whose mass hangs `down` metres below its joint."""
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {-down}"/><mass value="{mass}"/>{INERTIA}'
        "</inertial></link>"
    )


def joint(
    name: str,
    kind: str,
    child: str,
    parent: str = "ground",
    axis: str = "1 0 0",
    damping: float = 0.0,
    extra: str = "",
) -> str:
    limit = '<limit lower="-1e6" upper="1e6" effort="0" velocity="0"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/>{limit}<dynamics damping="{damping}"/>{extra}</joint>'
    )


def urdf_settings(pairing: Pairing) -> dict[str, object]:
    """Return step and gravity, which a URDF cannot state, and MuJoCo's integrator."""
    settings = {"step": STEP, "gravity": [0, 0, -GRAVITY]}
    return settings | ({"integrator": pairing.integrator} if pairing.integrator else {})


def _urdf(pairing: Pairing, mechanism: str, folder: Path) -> tuple[ModelSpec, list[int]]:
    path = folder / "model.urdf"
    springs: tuple[Spring, ...] = ()
    if mechanism == "pendulum":
        parts = [link("rod", MASS, LENGTH), joint("q1", "continuous", "rod", axis="0 -1 0")]
        size = 1
    else:
        m, k, c, pair = MECHANISMS[mechanism]
        parts, size = [], len(m)
        for i, (mi, ki, ci) in enumerate(zip(m, k, c, strict=True), start=1):
            parts += [
                link(f"b{i}", mi),
                joint(f"q{i}", "prismatic", f"b{i}", damping=ci),
                f'<gazebo reference="q{i}"><springStiffness>{ki}</springStiffness></gazebo>',
            ]
        if pair:
            springs = (Spring({"q1": -1.0, "q2": 1.0}, pair[0], pair[1], 0.0),)
    path.write_text(f'<robot name="small">{GROUND}{"".join(parts)}</robot>')
    return ModelSpec(path, springs, urdf_settings(pairing)), list(range(size))


def _python(pairing: Pairing, mechanism: str, folder: Path) -> tuple[ModelSpec, list[int]]:
    m, k, c, pair = MECHANISMS[mechanism]
    path = folder / "space.py"
    lines = ["import pymunk", "def build():", "    s = pymunk.Space()", "    g = s.static_body"]
    for i, (mi, ki, ci) in enumerate(zip(m, k, c, strict=True)):
        wall = -GAP if i == 0 else GAP * len(m)
        lines += [
            f"    b{i} = pymunk.Body({mi}, float('inf'))",
            f"    s.add(b{i})",
            f"    b{i}.position = ({GAP * i}, 0)",
        ]
        if ki or ci:
            ends = f"({wall}, 0), (0, 0), {GAP}, {ki}, {ci}"
            lines.append(f"    s.add(pymunk.DampedSpring(g, b{i}, {ends}))")
    if pair:
        ends = f"(0, 0), (0, 0), {GAP}, {pair[0]}, {pair[1]}"
        lines.append(f"    s.add(pymunk.DampedSpring(b0, b1, {ends}))")
    bodies = ", ".join(f"'b{i}': b{i}" for i in range(len(m)))
    lines.append(f"    return s, {{{bodies}}}")
    path.write_text("\n".join(lines) + "\n")
    return ModelSpec(path, (), {"step": STEP}), [3 * i for i in range(len(m))]


def _known_answer(pairing: Pairing, mechanism: str, folder: Path) -> tuple[ModelSpec, list[int]]:
    path = folder / "model.known"
    if mechanism == "pendulum":
        inertia = [[MASS * LENGTH**2]]
        M, C, K, W = inertia, [[0.0]], [[0.0]], [MASS * GRAVITY * LENGTH]
    else:
        M, C, K = (a.tolist() for a in matrices(mechanism))
        W = [0.0] * len(M)
    names = [f"q{i + 1}" for i in range(len(M))]
    path.write_text(
        f'names = {names}\nM = {M}\nC = {C}\nK = {K}\nW = {W}\nstep = {STEP}\nmethod = "euler"\n'
        "claims = 1\n"
    )
    return ModelSpec(Path(path)), list(range(len(M)))


_WRITERS: dict[str, Callable[[Pairing, str, Path], tuple[ModelSpec, list[int]]]] = {
    "mjcf": _mjcf,
    "urdf": _urdf,
    "python": _python,
    "known": _known_answer,
}

PAIRINGS = (
    *(Pairing("mujoco", "mjcf", i) for i in ("Euler", "implicit", "implicitfast", "RK4")),
    Pairing("mujoco", "urdf", "Euler"),
    Pairing("pybullet", "urdf"), Pairing("pymunk", "python"), Pairing("known", "known"),
)  # fmt: skip

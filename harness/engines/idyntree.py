"""iDynTree, on URDF: the accelerations of its mass matrix and bias forces, stepped here.

iDynTree has no stepper. Its dynamics take no account of the dampers and the friction of joints that
it reads, nor of limits, contacts and `<mimic>`. A link without mass that hangs on a fixed joint is
a frame of its neighbour to it, so that the file's root need not be its base link.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.engines.attitude import cross, matrix, turned
from physics_crosscheck.harness.engines.captured import STDERR, STDOUT, captured
from physics_crosscheck.harness.engines.following import held_accelerations, leading
from physics_crosscheck.harness.engines.installed import quietly
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Model, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.runge_kutta import each_alone, to_state
from physics_crosscheck.harness.engines.source import folded
from physics_crosscheck.harness.engines.stepped_here import (
    ADDED_HERE,
    SteppedHere,
    dampers_not_added,
)
from physics_crosscheck.harness.engines.tree_model import FREE
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.engines.urdf_copy import with_masses, without_shapes
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine, UrdfModel

MIMICS = "iDynTree's leaving out of <mimic>"
MASSLESS = "iDynTree's taking of links without mass for frames"

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ADDED_HERE,
    # Whether a link with moments and no mass keeps them; to iDynTree it is a frame.
    "massless_links": False,
})  # fmt: skip

READER = UrdfReader(
    name="idyntree",
    no_inertial="no mass and no moments",
    no_friction="iDynTree",
    no_stops="iDynTree",
)


class IdyntreeEngine(UrdfEngine):
    """Adapter of iDynTree (Nori et al. 2015, Frontiers in Robotics and AI 2:6)."""

    name = package = distribution = extra = "idyntree"
    title = "iDynTree"
    defaults = DEFAULTS
    capabilities = (
        "joints: slide, hinge, floating root",
        "springs: added by the adapter",
        "mimic: held by the adapter",
        "next state: yes",
        "accelerations: yes",
        "linearization: from steps",
        "steps: RK4 by the adapter, order 4",
    )
    unstated = "no step, since it takes none, and no gravity"
    ignores = frozenset({"dynamics@friction"})
    usual_mistakes = (dampers_not_added("iDynTree"),)

    def loaded(self, spec: ModelSpec) -> Model:
        """A file whose settings are in order."""
        return IdyntreeModel(spec)


class IdyntreeModel(SteppedHere, UrdfModel):
    """A tree of slides and hinges, fixed or not."""

    def __init__(self, spec: ModelSpec) -> None:
        idt = quietly("idyntree.bindings")
        kept = (with_masses,) if spec.settings.get("massless_links") else ()
        UrdfModel.__init__(self, spec, "iDynTree", READER, DEFAULTS, (without_shapes, *kept))
        self._loader = idt.ModelLoader()  # what it has read goes with it
        with captured((STDOUT, STDERR), again=False) as said:
            done = self._loader.loadModelFromString(self.declared.text, "urdf")
        # Of what it can't read it goes on with what is left, and says so.
        if not done or any("[ERROR]" in text for text in said):
            raise EngineError(f"{spec.path}: iDynTree can't load it: {folded(' '.join(said))}")
        self._model = self._loader.model()
        self._centres = {
            self._model.getLinkName(i): np.array(link.getCenterOfMass().toNumPy())
            for i in range(self._model.getNrOfLinks())
            if (link := self._model.getLink(i).getInertia()).getMass() > 0
        }
        self._computed = idt.KinDynComputations()
        self._computed.loadRobotModel(self._model)
        self._mass = idt.FreeFloatingMassMatrix(self._model)
        self._bias = idt.FreeFloatingGeneralizedTorques(self._model)
        self._springs = self.dampers(*self._joints())
        held = self.mimics if self.settings["hold_mimics"] else ()
        self._along = leading(held, self.coordinates, self.path) if held else None
        # Where its base link is in the file's root link.
        base = self._model.getLinkName(self._model.getDefaultBaseLink())
        placed = self._computed.getRelativeTransform(self.declared.root, base)
        self._turn = np.array(placed.getRotation().toNumPy())
        self._arm = np.array(placed.getPosition().toNumPy())
        self._down = np.array(self.gravity)
        if self.floats:
            self.step_by(self._floating)
        else:
            # A base link that stands still is where iDynTree's world is.
            self._down = self._turn.T @ self._down
            self.step_by(each_alone(self._fixed), self._fixed)

    def _joints(self) -> tuple[list[str], Array]:
        """Names and dampers of those that move, in iDynTree's order."""
        found = {}
        for i in range(self._model.getNrOfJoints()):
            joint, name = self._model.getJoint(i), self._model.getJointName(i)
            if joint.getNrOfDOFs() > 1:
                raise EngineError(f"{self.path}: joint {name!r} is neither a slide nor a hinge")
            if joint.getNrOfDOFs():
                found[joint.getDOFsOffset()] = name, float(joint.getDamping(0))
        ordered = [found[i] for i in sorted(found)]
        return [name for name, _ in ordered], np.array([one for _, one in ordered])

    def _terms(self, *state: Array) -> tuple[Array, Array]:
        """Mass matrix (6 + n, 6 + n) of a state, and forces at which nothing is accelerated."""
        self._computed.setRobotState(*state, self._down)
        self._computed.getFreeFloatingMassMatrix(self._mass)
        self._computed.generalizedBiasForces(self._bias)
        wrench, torques = self._bias.baseWrench().toNumPy(), self._bias.jointTorques().toNumPy()
        return np.array(self._mass.toNumPy()), np.concatenate([wrench, torques])

    def _fixed(self, x: Array, m: Array, f: Array) -> Array:
        """Of one state, (n,) each."""
        pull = f if self._springs.empty else f + self._springs.at(x, m)
        mass, bias = self._terms(x, m)
        return self._solved(mass[FREE:, FREE:], pull - bias[FREE:])

    def _floating(self, x: Array, m: Array, f: Array) -> Array:
        """Of the root's origin; iDynTree's are of its base link's, all along the world's axes."""
        pull, turn = f.copy(), matrix(x[:, 3:7])
        pull[:, FREE:] += self._springs.at(x[:, FREE + 1 :], m[:, FREE:])
        arm, spin = turn @ self._arm, turned(turn, m[:, 3:6])
        base = np.concatenate([m[:, :3] + cross(spin, arm), spin], axis=1)
        pull[:, 3:6] = turned(turn, f[:, 3:6]) - cross(arm, f[:, :3])
        rows = zip(turn, x, base, m[:, FREE:], strict=True)
        terms = [self._terms(self._frame(w, q[:3]), q[FREE + 1 :], v, u) for w, q, v, u in rows]
        mass, bias = (np.array(part) for part in zip(*terms, strict=True))
        a = self._solved(mass, pull - bias)
        a[:, :3] -= cross(a[:, 3:6], arm) + cross(spin, cross(spin, arm))
        a[:, 3:6] = turned(turn.swapaxes(1, 2), a[:, 3:6])
        return a

    def _frame(self, turn: Array, origin: Array) -> Array:
        """Where the base link is, (4, 4), by where the root link is."""
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = turn @ self._turn, origin + turn @ self._arm
        return found

    def _solved(self, mass: Array, pull: Array) -> Array:
        if self._along is not None:
            return held_accelerations(mass, pull, self._along)
        try:
            return np.asarray(np.linalg.solve(mass, pull[..., None])[..., 0], dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.full_like(pull, np.inf)

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """What iDynTree leaves out and the settings let stand, with what undoes it."""
        lost: dict[str, Mapping[str, object]] = {}
        if self.mimics and self._along is None:
            lost[MIMICS] = {"hold_mimics": True}
        if any(
            moment for link, moment in self.declared.moments.items() if link not in self._centres
        ):
            lost[MASSLESS] = {"massless_links": True}
        return {**self.undamped, **lost}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the URDF says in vain, and dampers that are left out."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.damping_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Links, and the centres of those that have a mass."""
        names = self.declared.links
        return (
            *(f"link:{n}" for n in names),
            *(f"centre:{n}" for n in names if n in self._centres),
        )

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        x = to_state(z, 0 * z)[0] if self.floats else z
        for i, row in enumerate(x):
            turn = matrix(row[None, 3:7])[0] if self.floats else np.eye(3)
            origin, q = (row[:3], row[FREE + 1 :]) if self.floats else (np.zeros(3), row)
            rest = np.zeros(FREE), np.zeros(len(q)), self._down
            self._computed.setRobotState(self._frame(turn, origin), q, *rest)
            for k, (kind, _, link) in enumerate(place.partition(":") for place in places):
                at = self._computed.getWorldTransform(link)
                turns[i, k] = at.getRotation().toNumPy()
                origins[i, k] = at.getPosition().toNumPy()
                if kind == "centre":
                    origins[i, k] += turns[i, k] @ self._centres[link]
        return origins, turns

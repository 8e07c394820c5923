"""iDynTree, on URDF: accelerations of its mass matrix and bias forces, stepped by the adapter.

iDynTree has no integrator. It reads joint dampers and friction, but its dynamics ignore them, and
ignore limits, contacts and `<mimic>`. A link without mass on a fixed joint becomes a frame of its
neighbour, so the base link can differ from the file's root.
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    cross,
    from_quaternion,
    rotate,
    rotate_back,
)
from .installed import STDERR, STDOUT, capture_output, import_quietly
from .protocol import Array, EngineError, LoadedModel, ModelSpec
from .remark import Remark
from .runge_kutta import FREE, each_alone
from .source import load_failure, one_line
from .stepped_here import ADDED_HERE, CAPABILITIES, SteppedHere, dampers_not_added
from .tree_model import constrained_accelerations, leader_matrix
from .urdf import UrdfReader
from .urdf_copy import bare_cause, with_masses, without_shapes
from .urdf_engine import UrdfEngine, UrdfModel

MIMICS = "iDynTree's leaving out of <mimic>"

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ADDED_HERE,
    # Whether a link with moments of inertia and no mass keeps them; iDynTree reads it as a frame.
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
    capabilities = CAPABILITIES
    default_settings_note = "no step, since it takes none, and no gravity"
    ignores = frozenset({"dynamics@friction"})
    usual_mistakes = (dampers_not_added("iDynTree"),)

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        return IdyntreeModel(spec)


class IdyntreeModel(SteppedHere, UrdfModel):
    """A tree of slides and hinges, fixed or floating."""

    def __init__(self, spec: ModelSpec) -> None:
        idt = import_quietly("idyntree.bindings")
        kept = (with_masses,) if spec.settings.get("massless_links") else ()
        UrdfModel.__init__(self, spec, "iDynTree", READER, DEFAULTS, (without_shapes, *kept))
        self._loader = idt.ModelLoader()  # owns the model
        with capture_output((STDOUT, STDERR), again=False) as printed:
            done = self._loader.loadModelFromString(self.declared.text, "urdf")
        # After an error iDynTree continues with the rest of the file.
        if not done or any("[ERROR]" in text for text in printed):
            raise load_failure("iDynTree", spec.path, one_line(" ".join(printed)))
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
        self._along = leader_matrix(held, self.coordinates, self.path) if held else None
        # Pose of iDynTree's base link in the file's root link.
        base = self._model.getLinkName(self._model.getDefaultBaseLink())
        placed = self._computed.getRelativeTransform(self.declared.root, base)
        self._turn = np.array(placed.getRotation().toNumPy())
        self._arm = np.array(placed.getPosition().toNumPy())
        self._down = np.array(self.gravity)
        if self.floats:
            self.step_by(self._floating)
        else:
            # A fixed base link is the origin of iDynTree's world.
            self._down = self._turn.T @ self._down
            self.step_by(each_alone(self._fixed), self._fixed)

    def _joints(self) -> tuple[list[str], Array]:
        """Return names and dampers of moving joints, in iDynTree's order."""
        joints = {}
        for i in range(self._model.getNrOfJoints()):
            joint, name = self._model.getJoint(i), self._model.getJointName(i)
            if joint.getNrOfDOFs() > 1:
                raise EngineError(f"{self.path}: joint {name!r} is neither a slide nor a hinge")
            if joint.getNrOfDOFs():
                joints[joint.getDOFsOffset()] = name, float(joint.getDamping(0))
        ordered = [joints[i] for i in sorted(joints)]
        return [name for name, _ in ordered], np.array([one for _, one in ordered])

    def _mass_and_bias(self, *state: Array) -> tuple[Array, Array]:
        """Return the mass matrix (6 + n, 6 + n) of a state, and its bias forces."""
        self._computed.setRobotState(*state, self._down)
        self._computed.getFreeFloatingMassMatrix(self._mass)
        self._computed.generalizedBiasForces(self._bias)
        wrench, torques = self._bias.baseWrench().toNumPy(), self._bias.jointTorques().toNumPy()
        return np.array(self._mass.toNumPy()), np.concatenate([wrench, torques])

    def _fixed(self, x: Array, m: Array, f: Array) -> Array:
        """Return the accelerations of one state, (n,) each."""
        force = f if self._springs.empty else f + self._springs.forces(x, m)
        mass, bias = self._mass_and_bias(x, m)
        return self._solve(mass[FREE:, FREE:], force - bias[FREE:])

    def _floating(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations at the root's origin; iDynTree's are at its base link, along world
        axes.
        """
        forces, turn = f.copy(), from_quaternion(x[:, 3:7].T)
        forces[:, FREE:] += self._springs.forces(x[:, FREE + 1 :], m[:, FREE:])
        arm, spin = rotate(turn, self._arm[:, None]), rotate(turn, m[:, 3:6].T)
        base = np.concatenate([m[:, :3].T + cross(spin, arm), spin]).T
        forces[:, 3:6] = (rotate(turn, f[:, 3:6].T) - cross(arm, f[:, :3].T)).T
        rows = zip(np.moveaxis(turn, 2, 0), x, base, m[:, FREE:], strict=True)
        rows_of_terms = [
            self._mass_and_bias(self._frame(w, q[:3]), q[FREE + 1 :], v, u) for w, q, v, u in rows
        ]
        mass, bias = (np.array(part) for part in zip(*rows_of_terms, strict=True))
        a = self._solve(mass, forces - bias)
        a[:, :3] -= (cross(a[:, 3:6].T, arm) + cross(spin, cross(spin, arm))).T
        a[:, 3:6] = rotate_back(turn, a[:, 3:6].T).T
        return a

    def _frame(self, turn: Array, origin: Array) -> Array:
        """Return the pose (4, 4) of the base link for a pose of the root link."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn @ self._turn, origin + turn @ self._arm
        return pose

    def _solve(self, mass: Array, force: Array) -> Array:
        if self._along is not None:
            return constrained_accelerations(mass, force, self._along)
        try:
            return np.asarray(np.linalg.solve(mass, force[..., None])[..., 0], dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.full_like(force, np.inf)

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """Elements that iDynTree leaves out under the current settings, with corrections."""
        lost: dict[str, Mapping[str, object]] = {}
        if self.mimics and self._along is None:
            lost[MIMICS] = {"hold_mimics": True}
        moments, names = self.declared.moments, self._centres
        links = self.declared.robot.findall("link")
        if frames := [
            one for one in links if moments.get(one.get("name")) and one.get("name") not in names
        ]:
            cause = bare_cause(frames, "iDynTree's removal", "without mass")
            lost[cause] = {"massless_links": True}
        return {**self.undamped, **lost}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the URDF, and omitted dampers."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.damping_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Links, and the centres of links with mass."""
        names = self.declared.links
        return (
            *(f"link:{n}" for n in names),
            *(f"centre:{n}" for n in names if n in self._centres),
        )

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by iDynTree's forward kinematics."""
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        x = self.layout.to_state(z, 0 * z)[0]
        for i, row in enumerate(x):
            turn = from_quaternion(row[3:7]) if self.floats else np.eye(3)
            origin, q = (row[:3], row[FREE + 1 :]) if self.floats else (np.zeros(3), row)
            rest = np.zeros(FREE), np.zeros(len(q)), self._down
            self._computed.setRobotState(self._frame(turn, origin), q, *rest)
            for k, (kind, _, link) in enumerate(place.partition(":") for place in places):
                pose = self._computed.getWorldTransform(link)
                turns[i, k] = pose.getRotation().toNumPy()
                origins[i, k] = pose.getPosition().toNumPy()
                if kind == "centre":
                    origins[i, k] += turns[i, k] @ self._centres[link]
        return origins, turns

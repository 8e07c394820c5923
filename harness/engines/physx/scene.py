"""A stage in PhysX, and the layer over the user's file that states what settings change."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.usd import UsdStage
from ..installed import import_quietly
from ..protocol import Array, EngineError, UnsupportedError
from ..source import one_line

FASTEST = 1e16
"""PhysX's own value of an unlimited speed."""

FAR = 1e6
"""Degrees, or units of length: a limit that no motion reaches."""

ITERATIONS = 32
"""Position iterations of an articulation that states none."""

BODY, ROOT = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"
HINGE, SLIDE, FIXED = (f"Physics{one}Joint" for one in ("Revolute", "Prismatic", "Fixed"))
ARTICULATION = "PhysxArticulationAPI"
COUNTS = "solverPositionIterationCount", "solverVelocityIterationCount"


@lru_cache(maxsize=1)
def _runtime() -> tuple[Any, Any]:
    ovphysx, ovstage = import_quietly("ovphysx"), import_quietly("ovstage")
    keys = ovphysx.types.GlobalConfigKey
    ovphysx.set_log_level(ovphysx.LogLevel.NONE)
    ovphysx.set_global_config(keys.NUM_THREADS, 0)  # a step takes a fifth of the time with a thread
    ovphysx.PhysX.set_cpu_mode(True)
    schemas = import_quietly("ovphysx.samples.python_samples.schema_support")
    paths = [*schemas.physx_schema_paths(), ovphysx.newton_schema_root()]
    ovstage.population.register_usd_schemas([str(one) for one in paths])
    return ovphysx, ovstage


class PhysxScene:
    """A stage in PhysX with one articulation, and its tensors in SI units and radians.

    Args:
        path: of the root layer.
        layer: what the root layer states.

    Attributes:
        joints, links: their names, in PhysX's order.
        slides: whether a joint is a slide, (n,).
        fixed: whether the root link does not move.
    """

    def __init__(self, path: Path, layer: StageLayer) -> None:
        ovphysx, ovstage = _runtime()
        self._types = ovphysx.types.TensorType
        self._root, self._bindings = layer.root, dict[str, tuple[Any, Any]]()
        self._stage = ovstage.Stage("crosscheck")
        domains = ovstage.population.PopulationDomain.ALL
        ovstage.population.open_usd(self._stage, str(path), ordinal=1, domains=domains)
        self._stage.advance_write_floor(ordinal=1).wait()
        self._physx = physx = ovphysx.PhysX()
        try:
            physx.wait_task(physx.attach_ovstage(self._stage, read_ordinal=1))
        except ovphysx.api.TaskError as error:
            physx.destroy()
            self._stage.destroy()
            problem = "PhysX can't attach the stage; it holds stages of one metersPerUnit at a time"
            raise EngineError(f"{problem}: {one_line(error)}") from None
        physx.warmup()
        binding = self._binding("DOF_POSITION")[0]
        if binding.count != 1:
            raise EngineError(f"PhysX finds {binding.count} articulations at {layer.root}")
        self.joints, self.links = list(binding.dof_names), list(binding.body_names)
        self.fixed = bool(binding.is_fixed_base)
        slides = [name for name, (_, kind, _) in layer.joints.items() if kind == SLIDE]
        self.slides = np.isin(self.joints, slides)
        self._units = self._si_units(layer.unit, layer.mass_unit)

    def _si_units(self, length: float, mass: float) -> dict[str, Any]:
        energy, place = mass * length**2, np.array([length] * 3 + [1.0] * 4)
        joints = np.where(self.slides, length, 1.0)
        moved = joints if self.fixed else np.concatenate([place[:6], joints])
        force, gain = energy / moved, energy / joints**2
        return {
            **dict.fromkeys(("ROOT_POSE", "LINK_POSE", "BODY_COM_POSE"), place),
            "ROOT_VELOCITY": place[:6],
            "LINK_WRENCH": np.concatenate([energy / place[:6], place[:3]]),
            "BODY_MASS": mass,
            "BODY_INERTIA": energy,
            "MASS_MATRIX": energy / np.outer(moved, moved),
            **dict.fromkeys(("GRAVITY_FORCE", "CORIOLIS_AND_CENTRIFUGAL_FORCE"), force),
            "DOF_LIMIT": joints[:, None],
            "DOF_FRICTION_PROPERTIES": gain[:, None],
            **{f"DOF_{one}{end}": joints for one in ("POSITION", "VELOCITY")
               for end in ("", "_TARGET")},
            **dict.fromkeys(("DOF_STIFFNESS", "DOF_DAMPING", "DOF_ARMATURE"), gain),
            **dict.fromkeys(("DOF_MAX_FORCE", "DOF_ACTUATION_FORCE"), energy / joints),
        }  # fmt: skip

    def _binding(self, name: str) -> tuple[Any, Any]:
        if name not in self._bindings:
            kind = getattr(self._types, f"ARTICULATION_{name}")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)  # the extra excludes 0.8
                binding = self._physx.create_tensor_binding(pattern=self._root, tensor_type=kind)
            number = np.uint8 if name == "DOF_DRIVE_TYPE" else np.float32
            self._bindings[name] = binding, np.zeros(binding.shape, dtype=number)
        return self._bindings[name]

    def read(self, name: str) -> Array:
        """Return a tensor of the articulation."""
        binding, buffer = self._binding(name)
        binding.read(buffer)
        result: Array = buffer[0].astype(float) * self._units.get(name, 1.0)
        return result

    def write(self, name: str, values: Array) -> None:
        """Set a tensor of the articulation."""
        binding, buffer = self._binding(name)
        buffer[0] = values / self._units.get(name, 1.0)
        binding.write(buffer)

    def step(self, h: float) -> None:
        """Advance by h seconds."""
        self._physx.step_sync(h)

    def close(self) -> None:
        """Release the stage."""
        for binding, _ in self._bindings.values():
            binding.destroy()
        self._physx.wait_task(self._physx.detach_ovstage())
        self._stage.destroy()
        self._physx.destroy()


class StageLayer:
    """A layer over a file with what the settings change, and the facts that it depends on.

    Attributes:
        text: of the layer.
        unit, mass_unit: m and kg per unit.
        root: path of the prim with the articulation root; `stated_root` that of the file.
        base: path of the joint that fixes a body to the world; empty for a floating root.
        iterations: numbers of position and velocity iterations of a step.
        joints: path, type and name here of slides and hinges, by PhysX's name.
        has_followers: whether a joint follows another one.
        massless, momentless: names of bodies for which the file states no mass or no moments.
        limits: of slides and hinges in the file, m or rad, by PhysX's name.
        ends: PhysX's names of each joint and of its two bodies; empty for the world.

    Raises:
        UnsupportedError: without exactly one articulation root, or with equal names.
    """

    def __init__(self, file: UsdStage, settings: Mapping[str, object], held: Sequence[str]) -> None:
        self._file, self._settings = file, settings
        self.unit, self.mass_unit = file.unit, file.mass_unit
        bodies, joints = [*file.bodies.values()], [*file.joints.values()]
        moving = [prim for prim in joints if prim.GetTypeName() in (HINGE, SLIDE)]
        self._names(bodies, file.bodies)
        names = self._names(moving, file.joints)
        self.joints = {
            prim.GetName(): (str(prim.GetPath()), str(prim.GetTypeName()), names[prim.GetName()])
            for prim in moving
        }
        self.has_followers = any(
            name.startswith(("newton:mimicJoint", "physxMimicJoint:"))
            for prim in moving
            for name in prim.GetAuthoredPropertyNames()
        )
        self.massless = [one.GetName() for one in bodies if not file.stated(one, "physics:mass")]
        self.momentless = [
            one.GetName()
            for one in bodies
            if not any(file.stated(one, "physics:diagonalInertia") or ())
        ]
        self.limits = {prim.GetName(): self._limits(prim) for prim in moving}
        self.ends = [(one.GetName(), self._end(one, 0), self._end(one, 1)) for one in joints]
        self.base = next(self._bases(joints), "")
        roots = [prim for prim in file.prims if ROOT in prim.GetAppliedSchemas()]
        if len(roots) != 1:
            problem = f"{len(roots)} prims have {ROOT}, and the adapter takes one; PhysX"
            problem += " joins bodies without it by constraints"
            raise UnsupportedError(problem, file=file.path)
        with file.pxr.Usd.EditContext(file.stage, file.stage.GetSessionLayer()):
            self.stated_root = str(roots[0].GetPath())
            self.root = self._place_root(roots[0], bodies)
            links = [one.GetPath() for one in bodies]
            shapes = [
                one.GetPath()
                for one in file.prims
                if "PhysicsCollisionAPI" in one.GetAppliedSchemas() and not file.body_of(one)
            ]
            for path in links:
                self._set_link(self._copied(path))
            self._set_joints(held)
            for prim in filter(file.is_outside, joints if settings["smooth"] else ()):
                file.switch_off(prim)
            for path in shapes if settings["smooth"] else ():
                self._set(self._copied(path), "", "physics:collisionEnabled", False)
            if list(settings["gravity"]) != list(file.gravity):  # type: ignore[call-overload]
                self._set_gravity(settings["gravity"])  # type: ignore[arg-type]
        layer = file.pxr.Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(file.stage.GetSessionLayer())
        self.text = file.over_file(layer)

    def _names(self, prims: Sequence[Any], among: Mapping[str, Any]) -> dict[str, str]:
        names = {one.GetName(): name for name, one in among.items() if one in prims}
        if len(names) < len(prims):
            twice = next(name for name in among if "/" in name)
            problem = f"{twice} has the name of another prim, and PhysX names them alike"
            raise UnsupportedError(problem, file=self._file.path)
        return names

    def _end(self, joint: Any, k: int) -> str:
        for path in self._file.targets(joint, f"physics:body{k}"):
            if body := self._file.body_of(self._file.stage.GetPrimAtPath(path)):
                return str(body.GetName())
        return ""

    def _limits(self, prim: Any) -> tuple[float, float]:
        unit = self.unit if prim.GetTypeName() == SLIDE else np.pi / 180
        lower = self._file.value(prim, "physics:lowerLimit", -np.inf) * unit
        return lower, self._file.value(prim, "physics:upperLimit", np.inf) * unit

    def _bases(self, joints: Sequence[Any]) -> Iterator[str]:
        for prim, (_, *ends) in zip(joints, self.ends, strict=True):
            is_on = self._file.value(prim, "physics:jointEnabled", True)
            is_fixed = prim.GetTypeName() == FIXED and "" in ends
            if is_fixed and is_on and not self._file.is_outside(prim):
                yield str(prim.GetPath())

    def _place_root(self, prim: Any, bodies: Sequence[Any]) -> str:
        file, path = self._file, str(prim.GetPath())
        is_body = BODY in prim.GetAppliedSchemas()
        if self.base:
            moves = is_body and not self._settings["root_as_stated"]
            path = self.base if moves else path
        elif not is_body:  # PhysX would choose the body with the shortest branches
            children = {child for _, _, child in self.ends}
            roots = [one for one in bodies if one.GetName() not in children]
            path = str((roots or bodies)[0].GetPath())
        position, velocity, collides = (
            file.stated(prim, f"physxArticulation:{name}")
            for name in (*COUNTS, "enabledSelfCollisions")
        )
        # With the schema that the adapter adds, PhysX no longer reads Newton's attribute.
        if collides is None:
            collides = file.stated(prim, "newton:selfCollisionEnabled")
        self.iterations = int(position or ITERATIONS), int(1 if velocity is None else velocity)
        numbers: dict[str, Any] = dict(zip(COUNTS, self.iterations, strict=True))
        numbers["enabledSelfCollisions"] = collides is not False and not self._settings["smooth"]
        numbers["sleepThreshold"] = 0.0
        if path != str(prim.GetPath()):
            for name in (ROOT, ARTICULATION, "NewtonArticulationRootAPI"):  # the last one has ROOT
                self._copied(prim.GetPath()).RemoveAppliedSchema(name)
        root = self._copied(path)
        root.AddAppliedSchema(ROOT)
        for name, value in numbers.items():
            self._set(root, ARTICULATION, f"physxArticulation:{name}", value)
        return path

    def _set_link(self, prim: Any) -> None:
        values = {"angularDamping": float(self._settings["angular_damping"])}  # type: ignore[arg-type]
        if not self._settings["bounded_speeds"]:
            values["maxAngularVelocity"] = FASTEST
        for name, value in values.items():
            if self._file.stated(prim, f"physxRigidBody:{name}") is None:
                self._set(prim, "PhysxRigidBodyAPI", f"physxRigidBody:{name}", value)

    def _set_joints(self, held: Sequence[str]) -> None:
        for name, (path, _, label) in list(self.joints.items()):
            if label in held:
                self._file.fix_joint(self._file.stage.GetPrimAtPath(path))
                del self.joints[name]
            elif self._settings["smooth"]:
                # PhysX drops a follower if it or its leader has no finite limits.
                prim, far = self._copied(path), FAR if self.has_followers else np.inf
                self._set(prim, "", "physics:lowerLimit", -far)
                self._set(prim, "", "physics:upperLimit", far)

    def _set_gravity(self, gravity: Sequence[float]) -> None:
        file, kind = self._file, "PhysicsScene"
        scene = next((one for one in file.stage.Traverse() if one.GetTypeName() == kind), None)
        scene = scene or file.stage.DefinePrim("/crosscheck_scene", kind)
        size, types = float(np.linalg.norm(gravity)), file.pxr.Sdf.ValueTypeNames
        along = file.pxr.Gf.Vec3f(*[one / size if size else 0.0 for one in gravity])
        scene.CreateAttribute("physics:gravityDirection", types.Vector3f, False).Set(along)
        self._set(scene, "", "physics:gravityMagnitude", size / file.unit)

    def _copied(self, path: Any) -> Any:
        """Return a prim; instances that it is in become copies, which can be changed."""
        stage = self._file.stage
        for above in reversed(list(self._file.pxr.Sdf.Path(path).GetAncestorsRange())):
            if stage.GetPrimAtPath(above).IsInstance():
                stage.GetPrimAtPath(above).SetInstanceable(False)
        return stage.GetPrimAtPath(path)

    def _set(self, prim: Any, schema: str, name: str, value: float | bool) -> None:
        if schema:
            prim.AddAppliedSchema(schema)
        types = self._file.pxr.Sdf.ValueTypeNames
        kind = {bool: types.Bool, int: types.Int, float: types.Float}[type(value)]
        prim.CreateAttribute(name, kind, False).Set(value)

"""A USD arm written by hand, and its edits."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.usd import read

ARM = """#usda 1.0
(
    defaultPrim = "arm"
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)
def PhysicsScene "scene" {
    float physics:gravityMagnitude = 9.81
}
def Xform "arm" (
    prepend apiSchemas = ["PhysicsArticulationRootAPI"]
) {
    def Xform "base" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        float physics:mass = 2
        float3 physics:diagonalInertia = (0.01, 0.01, 0.01)
        point3f physics:centerOfMass = (0, 0, 0.05)
    }
    def Xform "upper" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        double3 xformOp:translate = (0, 0, 0.125)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float physics:mass = 1.5
        point3f physics:centerOfMass = (0, 0.25, 0.125)
        float3 physics:diagonalInertia = (0.012, 0.011, 0.002)
        quatf physics:principalAxes = (0.98, 0.1, 0, 0.17)
    }
    def Xform "lower" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        double3 xformOp:translate = (0, 0, 0.375)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float physics:mass = 0.75
        point3f physics:centerOfMass = (0.0625, 0, 0.125)
        float3 physics:diagonalInertia = (0.0035, 0.003, 0.001)
    }
    def PhysicsFixedJoint "mount" {
        rel physics:body1 = </arm/base>
    }
    def PhysicsRevoluteJoint "shoulder" (prepend apiSchemas = ["PhysicsDriveAPI:angular"]) {
        rel physics:body0 = </arm/base>
        rel physics:body1 = </arm/upper>
        uniform token physics:axis = "Y"
        point3f physics:localPos0 = (0, 0, 0.125)
        float physics:lowerLimit = -90
        float physics:upperLimit = 90
        float drive:angular:physics:stiffness = 0.5
        float drive:angular:physics:damping = 0.25
        float drive:angular:physics:targetPosition = 20
    }
    def PhysicsRevoluteJoint "elbow" (prepend apiSchemas = ["NewtonJointAPI"]) {
        rel physics:body0 = </arm/upper>
        rel physics:body1 = </arm/lower>
        uniform token physics:axis = "X"
        point3f physics:localPos0 = (0, 0, 0.25)
        quatf physics:localRot0 = (0.9238795, 0, 0.3826834, 0)
        float newton:damping = 0.125
        float newton:armature = 0.0625
    }
}
"""


def edited(*edits: tuple[str, str], text: str = ARM) -> str:
    """Return the text with replacements, each of which it must contain."""
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    return text


def crate(folder: Path) -> Path:
    """Write the arm as a binary layer."""
    sdf = pytest.importorskip("pxr.Sdf")
    read_usd(folder)
    sdf.Layer.FindOrOpen(str(folder / "arm.usda")).Export(str(folder / "crate.usdc"))
    return folder / "crate.usdc"


def read_usd(folder: Path, text: str = ARM, name: str = "arm.usda") -> Robot:
    (folder / name).write_text(text)
    return read(folder / name, {})

"""The public names that users import."""

import importlib
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import physics_crosscheck
import physics_crosscheck.command
import physics_crosscheck.engine
import physics_crosscheck.records
import physics_crosscheck.sketch

ROOT = Path(__file__).parents[1]

TOP = {
    "CompareError", "Comparison", "Constant", "Coordinate", "CablePath", "Coupling",
    "DeclarationError", "Equilibrium", "Frame", "FrameForce", "Input", "Joint", "JointForce",
    "Fluid", "MotionError", "MultibodySystem", "Output", "Pose", "PublishedEquation",
    "ForceElement", "Quantity", "RigidBody", "RobotJoint", "RobotModel", "Scenario", "Site",
    "System", "Trajectory", "check", "load",
    "Buffer", "DryFriction", "Limit", "Contact", "Drive",
    "CheckResults", "compare", "ground", "rotation", "simulate", "solve", "t",
}  # fmt: skip
SKETCH = {"Angle", "Body", "Link"}
RECORDS = {
    "AuditFinding", "Case", "CaseId", "Cause", "CauseId", "ComparisonResult", "Diagnosis",
    "EngineLinearization", "Explanation", "FullRun", "Model", "ModelId", "Mutation", "Mutations",
    "Outcome", "Record", "Results", "ResultsError", "Series", "SourceLine", "SystemResult",
    "Verdict", "read_results",
}  # fmt: skip
COMMAND = {
    "AGREE", "DIFFER", "FAIL", "USAGE", "AppendAction", "Command", "group", "option",
}  # fmt: skip
ENGINE = {
    "Array", "Check", "CompiledTree", "DefaultLeftOn", "Engine", "EngineError", "Force",
    "LeftOut",
    "LoadedModel", "ModelSpec", "Remark", "Sample", "Spring", "StateForce", "conform",
    "conform_samples",
}  # fmt: skip


def test_public_names() -> None:
    for name, names in (
        ("", TOP), (".sketch", SKETCH), (".records", RECORDS), (".engine", ENGINE),
        (".command", COMMAND),
    ):  # fmt: skip
        module = importlib.import_module(f"physics_crosscheck{name}")
        assert set(module.__all__) == names
        assert all(getattr(module, name) is not None for name in names)


def test_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(physics_crosscheck, "nothing")


def test_packages_are_marked_as_typed() -> None:
    for package in ("physics_crosscheck", "harness", "reference"):
        assert (ROOT / package / "py.typed").is_file()


def test_package_import_is_light() -> None:
    heavy = "{'sympy', 'numpy', 'msgspec', 'mujoco', 'pybullet', 'pymunk'}"
    code = f"import sys, physics_crosscheck; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_tables_and_plots_are_imported_lazily() -> None:
    code = (
        "import sys; from physics_crosscheck import check, compare, simulate, solve;"
        " print(sorted({'pandas', 'polars', 'matplotlib', 'IPython'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_models_and_template_import_only_public_names() -> None:
    for file in (*ROOT.glob("models/*/*.py"), *ROOT.glob("template/*.py")):
        text = file.read_text()
        assert "from reference" not in text, file
        assert "harness" not in text, file


def test_version_matches_the_distribution() -> None:
    assert physics_crosscheck.__version__ == importlib.metadata.version("physics-crosscheck")

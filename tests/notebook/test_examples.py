"""The notebooks of `examples/`, executed; and the examples of `docs/reference/python.md`."""

import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.installed.documents import plain

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
PAGE = ROOT / "docs" / "reference" / "python.md"


def cells(notebook: Path) -> list[str]:
    read = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(one["source"]) for one in read["cells"] if one["cell_type"] == "code"]


def run(code: list[str], place: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run cells in order in a folder and return their output."""
    pytest.importorskip("matplotlib").use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.chdir(place)
    names: dict[str, Any] = {}
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output):
            for cell in code:
                exec(cell, names)
    finally:
        plt.close("all")
    return output.getvalue()


def test_four_notebooks_have_no_outputs() -> None:
    assert [one.stem for one in NOTEBOOKS] == [
        "choosing_a_time_step", "converted_robot", "pendulum", "urdf_against_mjcf",
    ]  # fmt: skip
    for notebook in NOTEBOOKS:
        read = json.loads(notebook.read_text(encoding="utf-8"))
        code = [one for one in read["cells"] if one["cell_type"] == "code"]
        assert all(one["outputs"] == [] and one["execution_count"] is None for one in code)
        assert sum("assert" in "".join(one["source"]) for one in code) >= 3


FAULTS = {
    "pendulum": [
        ("LENGTH, GRAVITY = 0.75, 9.81", "LENGTH, GRAVITY = 0.76, 9.81"),
        ('"simple_pendulum/mujoco.xml"', '"simple_pendulum/space.py"'),
    ],
    "urdf_against_mjcf": [
        ('<mass value="1.2"/>', '<mass value="1.2000001"/>'),
        ("'mass=\"0.71\"'", "'mass=\"0.7\"'"),
    ],
    "converted_robot": [
        ('<mass value="0.8"/>', '<mass value="0.81"/>'),
        ("0.8 * 0.15**2", "0.8 * 0.16**2"),
    ],
    "choosing_a_time_step": [
        ("solve(rod, \"free\", motion.t)", "solve(rod, \"large\", motion.t)"),
        ("(wanted / finest)", "(2 * wanted / finest)"),
    ],
}  # fmt: skip
"""Faults of each notebook that its assertions must detect: right and wrong text."""


@pytest.mark.release
@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [(name, *pair) for name, pairs in FAULTS.items() for pair in pairs],
    ids=lambda text: text[:24],
)
def test_fault_in_notebook_fails_an_assertion(
    name: str, right: str, wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pandas")
    code = cells(ROOT / "examples" / f"{name}.ipynb")
    assert any(right in cell for cell in code)
    with pytest.raises(AssertionError):
        run([cell.replace(right, wrong) for cell in code], tmp_path, monkeypatch)


@pytest.mark.release
def test_examples_of_page_print_documented_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pandas")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    code = [body for language, body in blocks if language == "python"]
    assert len(code) >= 6
    printed = "\n".join(map(plain, run(code, tmp_path, monkeypatch).splitlines()))
    expected = [line for language, body in blocks if not language for line in body.splitlines()]
    assert len(expected) >= 6
    for line in expected:
        assert plain(line) in printed, f"the page shows {line!r}:\n{printed}"

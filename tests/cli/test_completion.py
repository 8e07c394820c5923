"""Completions that a shell receives when Tab is pressed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.completion import SHELLS
from tests.faults.known_folder import environment


def completions(line: str, here: Path) -> list[str]:
    output = here / "completed"
    subprocess.run(
        [sys.executable, "-m", "physics_crosscheck"],
        cwd=here,
        check=False,
        timeout=300,
        env=environment()
        | {
            "_ARGCOMPLETE": "1",
            "_ARGCOMPLETE_STDOUT_FILENAME": str(output),
            "_ARGCOMPLETE_IFS": "\n",
            "COMP_LINE": line,
            "COMP_POINT": str(len(line)),
        },
    )
    return output.read_text().split("\n")


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("crosscheck ver", ["versions"]),
        ("crosscheck run --last", ["--last-failed"]),
        ("crosscheck run --engine mujo", ["mujoco"]),
        ("crosscheck run torsi", ["torsional_disc"]),
        ("crosscheck run --format gi", ["github"]),
        ("crosscheck completion z", ["zsh"]),
        ("crosscheck run 'my ar", ["my arm/"]),
    ],
)
def test_partial_command_line_is_completed(tmp_path: Path, line: str, wanted: list[str]) -> None:
    (tmp_path / "my arm").mkdir()
    results = [one.strip() for one in completions(line, tmp_path)]
    assert [one.replace("\\ ", " ").strip("'") for one in results] == wanted


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_its_script(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "physics_crosscheck", "completion", shell],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
        env=environment(),
    )
    assert "crosscheck" in done.stdout
    assert not done.stderr

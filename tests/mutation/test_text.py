"""Output and files of `crosscheck mutate`, from synthetic rows."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from physics_crosscheck.harness.commands.mutation.faults import FAULTS
from physics_crosscheck.harness.commands.mutation.survey import MutationError
from physics_crosscheck.harness.commands.mutation.text import mutation_lines, summary
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.terminal.progress import Counter
from physics_crosscheck.records import Mutation, Mutations

LITERAL, MISTAKE, NONE = FaultKind
NAMED, CAUGHT, REFUSED, UNTESTED, MISSED, AGREES = FaultVerdict


def row(
    kind: FaultKind,
    name: str,
    verdict: FaultVerdict,
    location: str = "joint[x]@stiffness",
    message: str = "",
    first: float | None = 1e-9,
) -> Mutation:
    return Mutation(
        system="swing",
        model="mujoco.xml",
        engine="mujoco",
        kind=kind,
        name=name,
        location=location,
        verdict=verdict,
        discrepancy=0.1,
        message=message,
        estimate_error=None,
        first_caught=first,
    )


ROWS = (
    *(row(LITERAL, name, NAMED) for name in FAULTS),
    *(row(LITERAL, name, UNTESTED, "joint[x]@range[0]", first=None) for name in FAULTS),
    row(MISTAKE, "axis flipped", NAMED, "x"),
    row(MISTAKE, "axis flipped", CAUGHT, "y", "gravity along z"),
    row(MISTAKE, "gravity off", UNTESTED, "option@gravity[2]", first=None),
    row(MISTAKE, "friction left in", MISSED, "x"),
    row(MISTAKE, "motors", REFUSED, "settings.motors", "it won't"),
    row(NONE, "another time step", AGREES, "step 0.004 s", "error at dt 1.0 % -> 2.0 %"),
)


def test_summary_counts_untested_literals_separately() -> None:
    assert summary(ROWS) == (
        "FAIL  11 faults: 1 missed; small faults: 3 of 3 caught, 3 named;"
        " mistakes: 6 of 7 caught, 5 named, 1 refused by the engine;"
        " another dt or integrator: 1 of 1 agree;"
        " 1 literal untested (no effect on motion)"
    )


def test_tables_have_a_row_per_literal_and_per_kind_of_mistake() -> None:
    lines = mutation_lines(ROWS)
    stiffness = next(line for line in lines if "joint[x]@stiffness" in line)
    assert stiffness.split() == ["joint[x]@stiffness", "1e-09", *["named"] * len(FAULTS)]
    assert "  another time step, step 0.004 s: agrees, error at dt 1.0 % -> 2.0 %" in lines
    flipped = next(line for line in lines if line.startswith("axis flipped"))
    assert flipped.split() == ["axis", "flipped", "2", "1", "1", ".", ".", ".", "1e-09"]
    assert lines[:2] == ["FAIL  11 faults: 1 missed", "  small faults: 3 of 3 caught, 3 named"]
    assert lines.index("missed:") < 8, "problems come first"


def test_faults_that_are_not_named_are_listed_with_their_messages() -> None:
    text = "\n".join(mutation_lines(ROWS))
    assert "cause:\n  swing/mujoco.xml [mujoco] y axis flipped: gravity along z\n" in text
    assert "missed:\n  swing/mujoco.xml [mujoco] x friction left in\n" in text
    assert "engine:\n  swing/mujoco.xml [mujoco] settings.motors motors: it won't" in text


def test_false_alarm_is_listed() -> None:
    wrong = row(NONE, "another time step", CAUGHT, "step 0.004 s", "damping on x")
    text = "\n".join(mutation_lines([wrong]))
    assert "false alarms:" in text
    assert "0 of 1 agree" in " ".join(text.split())


def test_json_has_every_row_and_no_infinity() -> None:
    text = encoded(Mutations(summary=summary(ROWS), rows=ROWS), indent=1)
    assert decoded(text.encode(), Mutations).rows == ROWS
    data = json.loads(text, parse_constant=pytest.fail)
    assert len(data["rows"]) == len(ROWS)
    untested = next(r for r in data["rows"] if r["location"] == "joint[x]@range[0]")
    assert untested["first_caught"] is None
    assert data["summary"] == summary(ROWS)


def test_progress_without_a_terminal_is_a_line_every_few_seconds(
    capsys: pytest.CaptureFixture[str],
) -> None:
    now = [0.0]
    with Counter("fault", "planting", clock=lambda: now[0]) as counter:
        counter(1, 0, None)  # the total is not known yet
        for done in range(2, 201):
            now[0] += 0.25
            counter(done, 200, None)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 9
    assert lines[0] == "planting: 21 of 200 faults done (10 %)"


@pytest.mark.parametrize(
    ("rows", "code"),
    [
        (ROWS, 1),  # one was missed
        ([r for r in ROWS if r.verdict is not MISSED], 0),
        ([row(NONE, "another time step", CAUGHT, "step 0.004 s")], 1),
    ],
)
def test_command_writes_json_and_sets_the_exit_code(
    rows: Sequence[Mutation],
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(
        "physics_crosscheck.harness.interfaces.cli.mutate.mutate", lambda *_, **__: list(rows)
    )
    file = tmp_path / "new" / "mutations.json"
    assert main(["mutate", "mass_spring_damper", "--json", str(file)]) == code
    assert len(json.loads(file.read_text())["rows"]) == len(rows)
    assert capsys.readouterr().out.startswith("FAIL  " if code else "ok  ")


def test_folder_that_differs_is_an_error_and_writes_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise MutationError("mujoco.xml: it differs already")

    monkeypatch.setattr("physics_crosscheck.harness.interfaces.cli.mutate.mutate", refuse)
    file = tmp_path / "mutations.json"
    assert main(["mutate", "mass_spring_damper", "--json", str(file)]) == 3
    output = capsys.readouterr()
    assert output.err.splitlines()[-1] == "crosscheck: mujoco.xml: it differs already"
    assert not output.out
    assert not file.exists()


def test_no_table_is_wider_than_the_terminal() -> None:
    for width in (60, 80):
        lines = mutation_lines(ROWS, width)
        assert max(map(len, lines)) <= width
        text = " ".join(" ".join(lines).split())
        assert "joint[x]@stiffness: detected from 1e-09; " in text
        assert "axis flipped: 2 planted, 1 named, 1 caught; detected from 1e-09" in text

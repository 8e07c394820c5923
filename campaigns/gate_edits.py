"""Edits of robot files, one at a time: does the gate pass any that states other physics?

`python -m campaigns.gate_edits FILE... --count 100 --engine mujoco`

Each file is copied, with those that it names, and accepted. Then one number, keyword or element
changes, in the file or in one that it includes, outside of `<visual>`. The table has the edits of
each kind, those that fail, and those that the output names. Only comments, format and colors may
pass. pybullet_data and gymnasium have robots.
"""

from __future__ import annotations

import argparse
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.commands.gate.accept import accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.survey import GateOptions
from physics_crosscheck.harness.commands.gate.text import gate_lines
from physics_crosscheck.harness.modelfiles.parts import parts

_NUMBERS = """
timestep range damping armature stiffness frictionloss margin friction contype conaffinity condim
solref solimp size density gear ctrlrange forcerange kp gravity effort velocity lower upper ixx
radius length xyz rpy axis scale mu lateral_friction
"""
"""Attributes whose first number changes."""

_ADDED = {
    "dry friction added": (r"<joint ", '<joint frictionloss="0.7" '),
    "limit softness added": (r"<joint ", '<joint solreflimit="0.05 1.1" '),
    "joint force limit added": (r"<joint ", '<joint actuatorfrcrange="-3 3" '),
    "integrator": (r"<option ", '<option cone="elliptic" '),
    "flag limit": (r"(</?worldbody>)", r'<option><flag limit="disable"/></option>\1'),
    "flag contact": (r"(<worldbody>)", r'<option><flag contact="disable"/></option>\1'),
    "floor removed": (r'<geom [^>]*type="plane"[^>]*/>', ""),
    "collision removed": (r"<collision>.*?</collision>", ""),
}
_HARMLESS = {
    "comment": (r"(<\w+)", r"<!-- edited -->\1"),
    "format": (r'="(\d+)"', r'=" \1.0 "'),
    "color": (r'rgba="[^"]*"', 'rgba="0.1 0.2 0.3 1"'),
}

_WHOLE = ("contype", "conaffinity", "condim")


def edits() -> Mapping[str, Callable[[str], str]]:
    """Return the edits of a text by kind; one that finds nothing returns it unchanged."""

    def replaced(pattern: str, text: str) -> Callable[[str], str]:
        return lambda old: re.sub(pattern, text, old, count=1, flags=re.DOTALL)

    def scaled(match: re.Match[str]) -> str:
        value = float(match[2])
        other = value + 1 if match[1].strip(" =\"'") in _WHOLE else 1.25 * value or 0.125
        return f"{match[1]}{other:g}"

    def number(name: str) -> Callable[[str], str]:
        pattern = rf"""(\b{name}=["']\s*)(-?[\d.]+(?:e-?\d+)?)(?=[\s"'])"""
        return lambda old: _outside_visual(pattern, scaled, old)

    patterns = {**_ADDED, **_HARMLESS}
    return {
        **{name: number(name) for name in _NUMBERS.split()},
        **{name: replaced(*pair) for name, pair in patterns.items()},
    }


def _outside_visual(pattern: str, new: Callable[[re.Match[str]], str], text: str) -> str:
    """Replace the first match that only pictures do not show."""
    for match in re.finditer(pattern, text):
        before = text[: match.start()]
        if before.count("<visual") == before.count("</visual>"):
            return before + new(match) + text[match.end() :]
    return text


class EditTrial(NamedTuple):
    """One edit: its kind, the file, whether the gate passed, and whether its output names it."""

    kind: str
    file: str
    passed: bool
    named: bool


def trials(file: Path, folder: Path, engines: tuple[str, ...]) -> Iterator[EditTrial]:
    """Accept a copy of a file, and gate it after each edit."""
    here = folder / "robots" / file.name
    for path in (file, *parts(file)):
        copy = here.parent / path.resolve().relative_to(file.resolve().parent)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    options = GateOptions(baseline=folder / "baseline", engines=engines, jobs=1)
    accept(gate([here], options, lambda *_: None), (), "campaign", options.baseline)
    texts = {here: True, **parts(here)}
    for kind, edit in edits().items():
        for path in (path for path, part in texts.items() if part):
            old = path.read_text(errors="replace")
            if (new := edit(old)) == old:
                continue
            path.write_text(new)
            result = gate([here], options, lambda *_: None)
            path.write_text(old)
            text = " ".join(gate_lines(result, 10**6))
            named = any(diff.changes and path.name in text for diff in result.file_diffs)
            yield EditTrial(kind, file.name, result.passes, named)
            break


def table(done: Sequence[EditTrial]) -> str:
    """Return the counts by kind as a Markdown table."""
    count, failed, named = (
        Counter(one.kind for one in done if keep(one))
        for keep in (lambda _: True, lambda one: not one.passed, lambda one: one.named)
    )
    rows = [f"| {kind} | {count[kind]} | {failed[kind]} | {named[kind]} |" for kind in count]
    return "\n".join(["| kind | edits | fail | named |", "|---|---|---|---|", *rows])


def main() -> None:
    """Edit each file in turn until enough edits are gated; exit with 1 if one passes wrongly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--engine", action="append", default=[])
    options = parser.parse_args()
    done = list[EditTrial]()
    for file in options.files:
        with tempfile.TemporaryDirectory() as folder:
            for trial in trials(file, Path(folder), tuple(options.engine)):
                done.append(trial)
                result = "passes" if trial.passed else "fails"
                print(f"{trial.file}: {trial.kind}: {result}", flush=True)
        if len(done) >= options.count:
            break
    print(table(done))
    wrong = [one for one in done if one.passed is not (one.kind in _HARMLESS)]
    print(f"{len(done)} edits, {len(wrong)} wrong: {wrong}")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()

"""Edits of robot files, one at a time: does the gate pass any that states other physics?

`python -m campaigns.gate_edits FILE... --count 100 --engine mujoco`

Each file is copied, with those that it names, and accepted by those of the engines that read it.
Then one number, keyword or element changes, in the file, in one that it includes, or in a mesh,
outside of `<visual>`. The table has the edits of each kind, those that fail, those of which the
output names file, line, old and new, those that no case tests (XC519), and those that pass. Only
comments, format, order of attributes, the robot's own name and colors may pass. pybullet_data and
gymnasium have robots.
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
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import gate_lines
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.harness.modelfiles.parts import parts
from physics_crosscheck.harness.modelfiles.robot_targets import source_file
from physics_crosscheck.harness.run import Options

_NUMBERS = """
timestep range damping armature stiffness frictionloss margin friction contype conaffinity condim
solref solimp size density gear ctrlrange forcerange kp gravity effort velocity lower upper ixx
radius length xyz rpy axis scale mu lateral_friction value iyy mass pose mu2 spring_stiffness
multiplier elevation max_step_size
"""
"""Attributes, or in an SDF elements, whose first number changes."""

_ADDED = {
    "dry friction added": (r"<joint ", '<joint frictionloss="0.7" '),
    "limit softness added": (r"<joint ", '<joint solreflimit="0.05 1.1" '),
    "joint force limit added": (r"<joint ", '<joint actuatorfrcrange="-3 3" '),
    "integrator": (r"<option ", '<option cone="elliptic" '),
    "flag limit": (r"(</?worldbody>)", r'<option><flag limit="disable"/></option>\1'),
    "flag contact": (r"(<worldbody>)", r'<option><flag contact="disable"/></option>\1'),
    "noslip": (r"<option ", '<option noslip_iterations="3" '),
    "mask": (r"<geom (?![^>]*con(type|aff))(?=[^>]*size)", '<geom contype="2" conaffinity="4" '),
    "gap": (r"<geom (?![^>]*gap)(?=[^>]*size)", '<geom margin="0.02" gap="0.01" '),
    "mimic removed": (r"<mimic[^>]*/>", ""),
    "dry friction in SDF": (r"(<dynamics>)(?!.{0,200}<friction>)", r"\1<friction>0.7</friction>"),
    "floor removed": (r'<geom [^>]*type="plane"[^>]*/>', ""),
    "collision removed": (r"<collision>.*?</collision>", ""),
}
_HARMLESS = {
    "comment": (r"(<\w+)", r"<!-- edited -->\1"),
    "format": (r'="(\d+)"', r'=" \1 "'),
    "color": (r'rgba="[^"]*"', 'rgba="0.1 0.2 0.3 1"'),
    "order of attributes": (r' (\w+="[^"]*") (\w+="[^"]*")/>', r" \2 \1/>"),
    "name of the robot": (r'(<robot name|<mujoco model)="[^"]*"', r'\1="other"'),
}

_WHOLE = ("contype", "conaffinity", "condim")


def edits() -> Mapping[str, Callable[[str], str]]:
    """Return the edits of a text by kind; one that finds nothing returns it unchanged."""

    def replaced(pattern: str, text: str) -> Callable[[str], str]:
        return lambda old: re.sub(pattern, text, old, count=1, flags=re.DOTALL)

    def scaled(match: re.Match[str]) -> str:
        value = float(match[2])
        other = value + 1 if match[1].strip(" =\"'<>") in _WHOLE else 1.25 * value or 0.125
        return f"{match[1]}{other:g}"

    def number(name: str) -> Callable[[str], str]:
        pattern = rf"""(\b{name}=["']\s*|<{name}>\s*)(-?[\d.]+(?:e-?\d+)?)(?=[\s"'<])"""
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


def edited_mesh(old: str) -> str:
    """Move the first vertex of an OBJ or of a binary STL, as Latin-1."""
    if re.search(r"(?m)^v ", old):
        return re.sub(r"(?m)^v (\S+)", lambda m: f"v {1.25 * float(m[1]) or 0.1}", old, count=1)
    data = bytearray(old.encode("latin-1"))
    if len(data) > 100 and not data.startswith((b"solid", b"<")):
        data[99] ^= 1  # twice or half the coordinate
    return data.decode("latin-1")


class EditTrial(NamedTuple):
    """One edit: its kind and file, whether the gate passed, named it, and calls it untested."""

    kind: str
    file: str
    passed: bool
    named: bool
    untested: bool


def trials(file: Path, folder: Path, engines: tuple[str, ...]) -> Iterator[EditTrial]:
    """Accept a copy of a file, and gate it after each edit."""
    here = folder / "robots" / file.name
    for path in (file, *parts(file)):
        copy = here.parent / path.resolve().relative_to(file.resolve().parent)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    suffix = ".urdf" if file.suffix == ".xacro" else file.suffix
    reading = {engine.name for engine in engines_reading(suffix)}
    chosen = tuple(name for name in engines if name in reading)
    options = Options(baseline=folder / "baseline", engines=chosen, jobs=1)

    def gated() -> GateResult:
        """Gate the file as it is; a xacro source is expanded first."""
        return gate([source_file(str(here)) or here], options, lambda *_: None)

    accept(gated(), (), "campaign", folder / "baseline")
    texts = {here: True, **parts(here)}
    shown = "".join(path.read_text("latin-1") for path, part in texts.items() if part)
    shown = re.sub(r"<visual.*?</visual>", "", shown, flags=re.DOTALL)
    for kind, edit in {**edits(), "mesh": edited_mesh}.items():
        for path, part in texts.items():
            if part is (kind == "mesh") or path.name not in shown + here.name:
                continue
            old = path.read_bytes().decode("latin-1")
            if (new := edit(old)) == old:
                continue
            path.write_bytes(new.encode("latin-1"))
            result = gated()
            path.write_bytes(old.encode("latin-1"))
            yield _trial(kind, file, path, result)
            break


def _trial(kind: str, file: Path, edited: Path, result: GateResult) -> EditTrial:
    text = " ".join(gate_lines(result, 10**6))
    places = [f"{edited.name}:{one.line} " for diff in result.file_diffs for one in diff.changes]
    named = any(place in text for place in places) and bool(re.search("->|added|removed", text))
    untested = any("untested" in change.kinds for change in result.failing)
    return EditTrial(kind, file.name, result.passes, named, untested)


def table(done: Sequence[EditTrial]) -> str:
    """Return the counts by kind as a Markdown table."""
    rows = dict[str, Counter[str]]()
    for trial in done:
        words = {"edits": True, "fail": not trial.passed, "named": trial.named,
                 "XC519": trial.untested, "pass": trial.passed}  # fmt: skip
        rows.setdefault(trial.kind, Counter()).update(
            word for word, holds in words.items() if holds
        )
    rows["all"] = sum(rows.values(), Counter[str]())
    heads = ("edits", "fail", "named", "XC519", "pass")
    lines = [
        f"| {kind} | {' | '.join(str(n[head]) for head in heads)} |" for kind, n in rows.items()
    ]
    return "\n".join([f"| kind | {' | '.join(heads)} |", "|---" * 6 + "|", *lines])


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
                result += " named" * trial.named + " XC519" * trial.untested
                print(f"{trial.file}: {trial.kind}: {result}", flush=True)
        if len(done) >= options.count:
            break
    print(table(done))
    wrong = [one for one in done if one.passed is not (one.kind in _HARMLESS)]
    print(f"{len(done)} edits, {len(wrong)} wrong: {wrong}")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()

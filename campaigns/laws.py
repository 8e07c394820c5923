"""Whole steps by law: files of other people, random scenes, and planted faults.

`python -m campaigns.laws files FILE...` compares MJCFs in MuJoCo and URDFs in PyBullet, roots fixed
(`--floating`: free), with their laws; `--engine mjx` and `drake` in these.
`python -m campaigns.laws faults FILE... --each 8` changes numbers by 1e-6 and 1 %.
`python -m campaigns.laws acting FILE...` counts the numbers that act at drawn states, by kind.
`python -m campaigns.laws tested FILE...` counts the tested numbers by kind.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaigns.planted.fates import Fate, Ground, plant
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.poses import case_poses
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.diagnosis.coverage import SMOOTH, NumberEffect, counted_numbers
from physics_crosscheck.harness.diagnosis.law_problem import (
    AnyLawProblem,
    diagnose_laws,
    law_problem,
)
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.numbers import Number
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.robot_system import RobotError
from physics_crosscheck.harness.records.outcome import Outcome

RESOLUTION = 1e-9
SIZES = (1e-6, 1e-2)
KINDS = (
    "friction", "solref", "solimp", "solreflimit", "solimplimit", "solreffriction",
    "solimpfriction", "margin", "gap", "condim", "range", "frictionloss", "armature", "damping",
    "kp", "kv", "gainprm", "biasprm", "dynprm", "gear", "forcerange", "ctrlrange",
    "actuatorfrcrange", "polycoef", "anchor", "impratio", "timestep", "size",
    "lower", "upper", "effort", "value",
)  # fmt: skip
"""Attributes whose numbers are changed."""

MOVING = ("armature", "damping", "stiffness")
"""Those of them whose numbers motions decide, without rows."""


def spec_of(file: Path, *, floating: bool = False) -> tuple[str, ModelSpec]:
    """Return the engine of a file, and what it loads."""
    if file.suffix != ".urdf":
        return "mujoco", ModelSpec(file)
    return "pybullet", ModelSpec(
        file, settings={**SETTINGS, **STANDALONE_SETTINGS, "floating": floating}
    )


def line(file: Path, other: str = "", *, floating: bool = False) -> tuple[str, str]:
    """Compare one file, in another engine if one is named; return its outcome and a line."""
    began = time.process_time()
    usual, spec = spec_of(file, floating=floating)
    engine = other or usual
    try:
        check = check_whole_step(file, spec, engine, RESOLUTION)
    except FileError as error:
        return "not loaded", f"{file.name}: {error.sentence[:100]}"
    if check is None:
        return "no law", file.name
    record, judged = check.record, check.judgement
    if judged is None:
        reason = ", ".join(record.uncovered)
        return ("not covered", f"{file.name}: {reason}") if reason else ("no joint", file.name)
    acted = ", ".join(f"{term.count} {term.name}" for term in record.acted)
    sizes = f"E {judged.largest_discrepancy:.1e} U {judged.largest_uncertainty:.1e}"
    seconds = time.process_time() - began
    text = f"{record.stated} attributes of the text, {len(record.misread)} compiled otherwise"
    states = f"{record.states} states, {acted}; {text}; {seconds:.1f} s"
    return str(judged.outcome), f"{file.name}: {judged.outcome} {sizes}; {states}"


def files(paths: Iterable[Path], engine: str = "", *, floating: bool = False) -> Counter[str]:
    """Compare files, and print a line for each."""
    counts = Counter[str]()
    for path in paths:
        outcome, text = line(path, engine, floating=floating)
        counts[outcome] += 1
        print(text, flush=True)
    return counts


@dataclass(frozen=True, kw_only=True, eq=False)
class Sound:
    """A file that agrees with its law, and the effects of its numbers at the drawn states.

    Attributes:
        task: the file in an engine.
        problem: its laws there.
    """

    task: TreeTask
    problem: AnyLawProblem

    @staticmethod
    def from_file(file: Path, *, floating: bool = False) -> Sound | None:
        """Return a file with its law; None without one."""
        engine, spec = spec_of(file, floating=floating)
        task = model_task(prepare_tree(file, states=2, floating=floating), engine)
        task = task.with_settings(**spec.settings)
        problem = law_problem(task)
        agrees = problem is not None and problem.judge(RESOLUTION).outcome is Outcome.AGREES
        return Sound(task=task, problem=problem) if agrees and problem is not None else None

    def faults(self, index: int) -> Iterator[tuple[str, float]]:
        """Yield the wrong values of a number, each with its name."""
        number = self.problem.numbers.numerals[index]
        if number.key == "condim":
            for value in self.problem.numbers.law_choices.get(index, ())[:2]:
                yield "another", value
            return
        for size in SIZES:
            yield f"{size:.0e}", number.value * (1 + size)

    def effect(self, index: int, value: float) -> float:
        """Return the largest relative effect of a number's value; NaN if it is unknown."""
        problem, number = self.problem, self.problem.numbers.numerals[index]
        if number.key == "condim":
            names = [(one.id.subject, one.value + one.correction) for one in problem.hypotheses]
            effect = problem.effect(names.index(((number.address,), value)))
            return float("nan") if effect is None else float(np.max(np.abs(effect), initial=0.0))
        if index not in problem.numbers.law_numbers:
            return 0.0
        effect = problem.effect(problem.numbers.law_numbers.index(index))
        largest = np.nan if effect is None else np.max(np.abs(effect), initial=0.0)
        return float(largest) * abs(value - number.value)

    def planted(self, index: int, value: float) -> Planted:
        """Load the file with another value of a number, compare and diagnose it."""
        numbers, task = self.problem.numbers, self.task
        number, acts = numbers.numerals[index], self.effect(index, value)
        texts = numbers.texts({index: value})
        with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
            wrong = task.with_file(copy_with_texts(task.file, texts, Path(folder)))
            try:
                problem = self.problem.in_engine(wrong.spec)
                if number.key == "size":
                    return _by_place(wrong, number, acts)
            except FileError:
                return Planted(acts=acts, outcome="refused", named=False)
        outcome = str(problem.judge(RESOLUTION).outcome)
        named = outcome == "DIFFERS" and _names(problem, number.address)
        return Planted(acts=acts, outcome=outcome, named=named)


@dataclass(frozen=True, kw_only=True)
class Planted:
    """One planted fault.

    Attributes:
        acts: its largest effect by the law, relative; of a shape, infinite.
        outcome: of the comparison.
        named: whether the diagnosis names the number, alone or among causes of equal effect; of a
            shape, whether its line is named.
    """

    acts: float
    outcome: str
    named: bool


def _by_place(wrong: TreeTask, number: Number, acts: float) -> Planted:
    """Compare the sizes of shapes in the engine with those of the file."""
    check = case_poses(wrong, *wrong.load())
    if check is None or not check.findings:
        return Planted(acts=acts, outcome="AGREES", named=False)
    named = number.line in {place.line for place in check.locations}
    return Planted(acts=np.inf, outcome="DIFFERS", named=named)


def _names(problem: AnyLawProblem, address: str) -> bool:
    ranking = diagnose_laws(problem)
    if not (ranking.explained and ranking.fits):
        return False
    causes = (*ranking.fits[0].causes, *ranking.fits[0].tied_with)
    single = len(ranking.fits[0].causes) == 1
    return single and any(cause.subject == (address,) for cause in causes)


def planted(
    file: Path,
    each: int,
    rng: np.random.Generator,
    kinds: Collection[str] = KINDS,
    *,
    floating: bool = False,
) -> Iterator[tuple[str, str, str, Planted]]:
    """Change numbers of a file; yield the attribute, the size, the address, and the result."""
    sound = Sound.from_file(file, floating=floating)
    if sound is None:
        print(file.name, "has no law that it agrees with")
        return
    numbers, groups = sound.problem.numbers, dict[str, list[int]]()
    law = {*numbers.law_numbers, *numbers.law_choices}
    for i, number in enumerate(numbers.numerals):
        # No law has a gap, so that a wrong one is no difference.
        other = number.key == "gap" or number.path.endswith("geom@size")
        if number.key in kinds and number.value and (i in law or other):
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each]:
            for size, value in sound.faults(int(i)):
                fault = sound.planted(int(i), value)
                yield key, size, numbers.numerals[int(i)].address, fault
    if set(MOVING) & set(kinds):
        yield from _planted_in_motion(file, each, rng, kinds, floating=floating)


def _planted_in_motion(
    file: Path,
    each: int,
    rng: np.random.Generator,
    kinds: Collection[str],
    *,
    floating: bool,
) -> Iterator[tuple[str, str, str, Planted]]:
    """Change numbers of forces that motions decide."""
    ground, groups = Ground.of(file, spec_of(file)[0], floating=floating), dict[str, list[int]]()
    for i in ground.numbers.relevant_numbers:
        number = ground.numbers.numerals[i]
        if number.key in MOVING and number.key in kinds and number.value:
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each].tolist():
            for size in SIZES:
                fault = plant(ground, i, size)
                named = fault.fate in (Fate.NAMED, Fate.TIED)
                caught = named or fault.fate is Fate.CAUGHT
                outcome = "DIFFERS" if caught else str(fault.fate)
                acts = fault.effect if fault.fate.seen else 0.0
                result = Planted(acts=acts, outcome=outcome, named=named)
                yield key, f"{size:.0e}", fault.address, result


def faults(
    paths: Iterable[Path], each: int, seed: int, kinds: Collection[str], *, floating: bool
) -> None:
    """Print, for each attribute and size, how many faults act, differ, and are named."""
    rng, total = np.random.default_rng(seed), dict[tuple[str, str], Counter[str]]()
    for path in paths:
        began, counts = time.process_time(), dict[tuple[str, str], Counter[str]]()
        for key, size, address, fault in planted(path, each, rng, kinds, floating=floating):
            count = counts.setdefault((key, size), Counter())
            acts = not fault.acts <= RESOLUTION
            caught = fault.outcome == "DIFFERS"
            count.update(planted=1, refused=fault.outcome == "refused", acts=acts)
            count.update(caught=acts and caught, named=acts and fault.named)
            if caught != acts or fault.named != caught:
                print(f"{path.name} {address} {size}: {fault}", flush=True)
        print(f"{path.parent.name}/{path.name}: {time.process_time() - began:.0f} s")
        _print_counts(counts)
        for row, count in counts.items():
            total.setdefault(row, Counter()).update(count)
    print("together")
    _print_counts(total)


def _print_counts(counts: Mapping[tuple[str, str], Counter[str]]) -> None:
    """Print the counts of each attribute and size, and their sum."""
    whole = sum(counts.values(), Counter[str]())
    for (key, size), count in [*sorted(counts.items()), (("all", ""), whole)]:
        print(
            f"{key:18} {size:8} planted {count['planted']:4}  acts {count['acts']:4}"
            f"  caught {count['caught']:4}  named {count['named']:4}  refused {count['refused']:3}",
            flush=True,
        )


def acting(paths: Iterable[Path], *, floating: bool) -> None:
    """Print, by attribute, how many numbers of the laws act at drawn states if changed by 1 %."""
    totals: dict[str, Counter[str]] = {}
    for path in paths:
        sound = Sound.from_file(path, floating=floating)
        if sound is None:
            print(f"{path.name} has no law that it agrees with")
            continue
        numbers = sound.problem.numbers
        for i in numbers.law_numbers:
            one = numbers.numerals[i]
            if one.key not in KINDS or not one.value:
                continue
            acts = not sound.effect(i, one.value * (1 + SIZES[1])) <= RESOLUTION
            totals.setdefault(one.key, Counter()).update(numbers=1, acts=acts)
            if not acts:
                print(f"{path.parent.name}/{path.name}: {one.address} does not act", flush=True)
    for key, count in sorted(totals.items()):
        print(f"{key:18} {count['acts']:4} of {count['numbers']:4}")


NOT_DYNAMIC = re.compile(
    r".*/(visual|sensor|keyframe|statistic|size|custom|texture|material|camera|light)[/@].*"
    r"|.*@(rgba|group|texrepeat|texuniform|reflectance|shininess|specular|user|cutoff)"
)
"""Numbers that are no dynamics by their kind."""


GROUPS = {
    "equalities": r".*/equality/.*|.*@(polycoef|anchor|relpose|torquescale)",
    "dry friction": r".*@(frictionloss|solreffriction|solimpfriction)",
    "limits of joints and tendons": r".*/(joint|fixed|spatial|tendon)@(\w*limit|range|margin)",
    "limits of drives": r".*@(ctrl|force|act|actuatorfrc|length)range",
    "drives": r".*/actuator/.*|.*@(kp|kv|gear|\w+prm|dampratio|timeconst)",
    "contact parameters": r".*/(geom|pair)@(friction|sol\w+|condim|margin|gap|priority|con\w+)"
    r"|.*@(impratio|o_\w+)",
    "shapes": r".*/(geom|mesh|hfield|vertex)@.*",
    "sites": r".*/site@.*",
    "bodies, joints and forces": r".*",
}
"""Kinds of numbers, by the first pattern that their paths match."""


def kind_of(path: str) -> str:
    """Return the element and attribute of a number, such as `joint@range`."""
    return path.rpartition("/")[2]


def tested(paths: Iterable[Path]) -> None:
    """Print the tested share of the numbers that dynamics may depend on, by kind.

    An overwritten default, or the position of a joint along its axis, has no effect at all.
    """
    totals, groups = dict[str, Counter[str]](), {name: Counter[str]() for name in GROUPS}
    for path in paths:
        began = time.process_time()
        try:
            task = model_task(prepare_tree(path), "mujoco")
            counted = counted_numbers(task, robot_numbers(path, task.spec.settings))
        except (FileError, RobotError) as error:
            print(f"{path.name}: {str(error)[:100]}")
            continue
        file = Counter[str]()
        for one in counted:
            if NOT_DYNAMIC.fullmatch(one.path):
                continue
            seen = one.bound or one.effect in (*SMOOTH, NumberEffect.SHAPES)
            words = {"tested" if seen else one.effect.value: 1, BEFORE: int(one.smooth)}
            group = next(name for name, kind in GROUPS.items() if re.fullmatch(kind, one.path))
            for count in (file, totals.setdefault(kind_of(one.path), Counter()), groups[group]):
                count.update(words)
        seconds = time.process_time() - began
        print(f"{path.parent.name}/{path.name}: {dict(file)}, {seconds:.0f} s", flush=True)
    whole = sum(totals.values(), Counter[str]())
    for kind, count in sorted(totals.items(), key=lambda item: -item[1].total()):
        rest = {word: number for word, number in count.items() if word not in ("tested", BEFORE)}
        print(f"{kind:30} {_shares(count, whole)}  {rest or ''}")
    for name, count in (*groups.items(), ("all", whole)):
        print(f"{name:30} {_shares(count, whole)}")
    print(dict(whole))


BEFORE = "by smooth motions"
"""Key of the numbers that are tested without whole steps and shapes; these are counted twice."""


def _shares(count: Counter[str], whole: Counter[str]) -> str:
    """Return how many numbers are tested, and without whole steps; untested shares of the whole."""
    size, total = (one.total() - one[BEFORE] for one in (count, whole))
    shares = (100 * (size - count[word]) / max(1, total) for word in ("tested", BEFORE))
    untested = ", before ".join(f"{share:.2f} %" for share in shares)
    return f"{count['tested']:6} of {size:6}, before {count[BEFORE]:6}; {untested} untested"


def main() -> None:
    """Run one of the campaigns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("files", "faults", "acting", "tested"))
    parser.add_argument("paths", nargs="*", type=Path)
    parser.add_argument("--floating", action="store_true")
    parser.add_argument("--engine", default="", help="of `files`, such as mjx or drake")
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--kind", action="append", help="attributes whose numbers are changed")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "files":
        print(dict(files(options.paths, options.engine, floating=options.floating)))
    elif options.what == "tested":
        tested(options.paths)
    elif options.what == "acting":
        acting(options.paths, floating=options.floating)
    else:
        kinds = options.kind or KINDS
        faults(options.paths, options.each, options.seed, kinds, floating=options.floating)


if __name__ == "__main__":
    main()

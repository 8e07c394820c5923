"""Whole steps of public robot files against the laws of their engines, and planted faults.

`python -m campaigns.laws files FILE...` compares MJCFs in MuJoCo and URDFs in PyBullet with their
laws. Roots are fixed, or free with `--floating`; `--engine mjx` or `drake` selects another engine.
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

from campaigns.planted.fates import FaultBaseline, FaultFate, judge_by_equations
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.poses import case_poses
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.diagnosis.coverage import SMOOTH, NumberEffect, counted_numbers
from physics_crosscheck.harness.diagnosis.law_problem import LawProblem, diagnose_laws, law_problem
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import RobotError, robot_numbers
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.collocation import ReferenceError

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
"""Attributes of `KINDS` whose numbers are tested by motions, not by whole steps."""


def spec_of(file: Path, engine: str = "", *, floating: bool = False) -> tuple[str, ModelSpec]:
    """Return the engine, or if that is empty the default one of a file, and the model to load."""
    if file.suffix != ".urdf":
        return engine or "mujoco", ModelSpec(file)
    return engine or "pybullet", ModelSpec(
        file, settings={**SETTINGS, **STANDALONE_SETTINGS, "floating": floating}
    )


def compare_file(file: Path, other: str = "", *, floating: bool = False) -> tuple[str, str]:
    """Compare a file, in engine `other` if that is not empty; return its outcome and a line."""
    began = time.process_time()
    engine, spec = spec_of(file, other, floating=floating)
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
    text = f"{record.stated} attributes in the text, {len(record.misread)} compiled differently"
    states = f"{record.states} states, {acted}; {text}; {seconds:.1f} s"
    return str(judged.outcome), f"{file.name}: {judged.outcome} {sizes}; {states}"


def compare_files(
    paths: Iterable[Path], engine: str = "", *, floating: bool = False
) -> Counter[str]:
    """Compare files, print a line for each, and return the counts of outcomes."""
    counts = Counter[str]()
    for path in paths:
        outcome, text = compare_file(path, engine, floating=floating)
        counts[outcome] += 1
        print(text, flush=True)
    return counts


@dataclass(frozen=True, kw_only=True, eq=False)
class LawBaseline:
    """A file that agrees with its law, and the effects of its numbers at the drawn states.

    Attributes:
        task: the file in an engine.
        problem: laws of the file in this engine.
    """

    task: TreeTask
    problem: LawProblem

    @staticmethod
    def from_file(file: Path, engine: str = "", *, floating: bool = False) -> LawBaseline | None:
        """Return the baseline of a file; None if it has no law or does not agree with it."""
        engine, spec = spec_of(file, engine, floating=floating)
        task = model_task(prepare_tree(file, states=2, floating=floating), engine)
        task = task.with_settings(**spec.settings)
        problem = law_problem(task)
        agrees = problem is not None and problem.judge(RESOLUTION).outcome is Outcome.AGREES
        return LawBaseline(task=task, problem=problem) if agrees and problem is not None else None

    def wrong_values(self, index: int) -> Iterator[tuple[str, float]]:
        """Yield the name and the value of each fault of a number."""
        number = self.problem.numbers.numerals[index]
        if number.key == "condim":
            for value in self.problem.numbers.law_choices.get(index, ())[:2]:
                yield "other", value
            return
        for size in SIZES:
            yield f"{size:.0e}", number.value * (1 + size)

    def effect(self, index: int, value: float) -> float:
        """Return the largest relative effect of a number's value; NaN if the law gives none."""
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

    def judge_fault(self, index: int, value: float) -> LawFault:
        """Load the file with another value of a number, compare and diagnose it."""
        numbers, task = self.problem.numbers, self.task
        number, acts = numbers.numerals[index], self.effect(index, value)
        texts = numbers.texts({index: value})
        with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
            wrong = task.with_file(copy_with_texts(task.file, texts, Path(folder)))
            try:
                problem = self.problem.in_engine(wrong.spec)
                if number.key == "size":
                    return _judge_shape(wrong, number, acts)
            except FileError:
                return LawFault(acts=acts, outcome="refused", named=False)
        outcome = str(problem.judge(RESOLUTION).outcome)
        named = outcome == "DIFFERS" and _names(problem, number.address)
        return LawFault(acts=acts, outcome=outcome, named=named)


@dataclass(frozen=True, kw_only=True)
class LawFault:
    """A planted fault and its result.

    Attributes:
        acts: largest relative effect by the law; infinite for a shape.
        outcome: of the comparison.
        named: whether the diagnosis names the number, alone or among causes of equal effect; for a
            shape, whether it names the line.
    """

    acts: float
    outcome: str
    named: bool


def _judge_shape(wrong: TreeTask, number: Number, acts: float) -> LawFault:
    """Judge a wrong size: compare the shapes in the engine with those of the file."""
    check = case_poses(wrong, *wrong.load())
    if check is None or not check.findings:
        return LawFault(acts=acts, outcome="AGREES", named=False)
    named = number.line in {place.line for place in check.locations}
    return LawFault(acts=np.inf, outcome="DIFFERS", named=named)


def _names(problem: LawProblem, address: str) -> bool:
    """Return whether the diagnosis names a number as the cause, alone or tied."""
    ranking = diagnose_laws(problem)
    if not (ranking.explained and ranking.fits):
        return False
    causes = (*ranking.fits[0].causes, *ranking.fits[0].tied_with)
    single = len(ranking.fits[0].causes) == 1
    return single and any(cause.subject == (address,) for cause in causes)


def plant_faults(
    file: Path,
    each: int,
    rng: np.random.Generator,
    kinds: Collection[str] = KINDS,
    *,
    engine: str = "",
    floating: bool = False,
) -> Iterator[tuple[str, str, str, LawFault]]:
    """Change numbers of a file; yield the attribute, size and address of each, and its result."""
    baseline = LawBaseline.from_file(file, engine, floating=floating)
    if baseline is None:
        print(file.name, "skipped: no law, or the file does not agree with it")
        return
    numbers, groups = baseline.problem.numbers, dict[str, list[int]]()
    law = {*numbers.law_numbers, *numbers.law_choices}
    for i, number in enumerate(numbers.numerals):
        # No law has a gap, so a wrong gap makes no difference.
        other = number.key == "gap" or number.path.endswith("geom@size")
        if number.key in kinds and number.value and (i in law or other):
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each]:
            for size, value in baseline.wrong_values(int(i)):
                fault = baseline.judge_fault(int(i), value)
                yield key, size, numbers.numerals[int(i)].address, fault
    if set(MOVING) & set(kinds):
        yield from _plant_in_motions(file, each, rng, kinds, engine=engine, floating=floating)


def _plant_in_motions(
    file: Path,
    each: int,
    rng: np.random.Generator,
    kinds: Collection[str],
    *,
    engine: str,
    floating: bool,
) -> Iterator[tuple[str, str, str, LawFault]]:
    """Change the numbers of `MOVING`; yield as `plant_faults`."""
    baseline = FaultBaseline.from_file(file, spec_of(file, engine)[0], floating=floating)
    groups = dict[str, list[int]]()
    for i in baseline.numbers.relevant_numbers:
        number = baseline.numbers.numerals[i]
        if number.key in MOVING and number.key in kinds and number.value:
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each].tolist():
            for size in SIZES:
                fault = judge_by_equations(baseline, i, size)
                named = fault.fate in (FaultFate.NAMED, FaultFate.TIED)
                caught = named or fault.fate is FaultFate.CAUGHT
                outcome = "DIFFERS" if caught else str(fault.fate)
                acts = fault.effect if fault.fate.is_visible else 0.0
                result = LawFault(acts=acts, outcome=outcome, named=named)
                yield key, f"{size:.0e}", fault.address, result


def count_faults(
    paths: Iterable[Path],
    each: int,
    seed: int,
    kinds: Collection[str],
    *,
    engine: str,
    floating: bool,
) -> None:
    """Print how many faults act, differ and are named, by attribute and size."""
    rng, total = np.random.default_rng(seed), dict[tuple[str, str], Counter[str]]()
    for path in paths:
        began, counts = time.process_time(), dict[tuple[str, str], Counter[str]]()
        planted = plant_faults(path, each, rng, kinds, engine=engine, floating=floating)
        for key, size, address, fault in planted:
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


def count_acting(paths: Iterable[Path], *, floating: bool) -> None:
    """Print how many numbers of the laws act at drawn states if changed by 1 %, by attribute."""
    totals: dict[str, Counter[str]] = {}
    for path in paths:
        baseline = LawBaseline.from_file(path, floating=floating)
        if baseline is None:
            print(f"{path.name} skipped: no law, or the file does not agree with it")
            continue
        numbers = baseline.problem.numbers
        for i in numbers.law_numbers:
            number = numbers.numerals[i]
            if number.key not in KINDS or not number.value:
                continue
            acts = not baseline.effect(i, number.value * (1 + SIZES[1])) <= RESOLUTION
            totals.setdefault(number.key, Counter()).update(numbers=1, acts=acts)
            if not acts:
                print(f"{path.parent.name}/{path.name}: {number.address} does not act", flush=True)
    for key, count in sorted(totals.items()):
        print(f"{key:18} {count['acts']:4} of {count['numbers']:4}")


NOT_DYNAMIC = re.compile(
    r".*/(visual|sensor|keyframe|statistic|size|custom|texture|material|camera|light)[/@].*"
    r"|.*@(rgba|group|texrepeat|texuniform|reflectance|shininess|specular|user|cutoff)"
)
"""Paths of numbers that dynamics never depend on."""


GROUPS = {
    "equalities": r".*/equality/.*|.*@(polycoef|anchor|relpose|torquescale)",
    "dry friction": r".*@(frictionloss|solreffriction|solimpfriction)",
    "limits of joints and tendons": r".*/(joint|fixed|spatial|tendon)@(\w*limit|range|margin)"
    r"|.*/limit@(lower|upper)",
    "limits of drives": r".*@(ctrl|force|act|actuatorfrc|length)range|.*/limit@(effort|velocity)",
    "drives": r".*/actuator/.*|.*@(kp|kv|gear|\w+prm|dampratio|timeconst)",
    "contact parameters": r".*/(geom|pair)@(friction|sol\w+|condim|margin|gap|priority|con\w+)"
    r"|.*@(impratio|o_\w+)|.*/contact/\w+@value",
    "shapes": r".*/(geom|mesh|hfield|vertex)@.*|.*/collision/.*",
    "sites": r".*/site@.*",
    "bodies, joints and forces": r".*",
}
"""Patterns of paths by group; a number belongs to the first group that matches."""


def count_tested(paths: Iterable[Path], engine: str, *, floating: bool) -> None:
    """Print the tested share of the numbers that dynamics may depend on, by kind.

    An overwritten default, or the position of a joint along its axis, has no effect at all.
    """
    totals, groups = dict[str, Counter[str]](), {name: Counter[str]() for name in GROUPS}
    for path in paths:
        began = time.process_time()
        try:
            task = model_task(prepare_tree(path, floating=floating), engine)
            counted = counted_numbers(task, robot_numbers(path, task.spec.settings))
        except (FileError, RobotError, ReferenceError) as error:
            print(f"{path.name}: {str(error)[:100]}")
            continue
        file = Counter[str]()
        for number in counted:
            if NOT_DYNAMIC.fullmatch(number.path):
                continue
            is_tested = number.effect in (*SMOOTH, NumberEffect.SHAPES)
            kind = "tested" if is_tested else "only read" if number.read else number.effect.value
            words = {kind: 1, SMOOTH_KEY: int(number.smooth)}
            group = next(key for key, k in GROUPS.items() if re.fullmatch(k, number.path))
            name = number.path.rpartition("/")[2]  # element and attribute, such as joint@range
            for count in (file, totals.setdefault(name, Counter()), groups[group]):
                count.update(words)
        seconds = time.process_time() - began
        print(f"{path.parent.name}/{path.name}: {dict(file)}, {seconds:.0f} s", flush=True)
    whole = sum(totals.values(), Counter[str]())
    for kind, count in sorted(totals.items(), key=lambda item: -item[1].total()):
        rest = {word: n for word, n in count.items() if word not in ("tested", SMOOTH_KEY)}
        print(f"{kind:30} {_shares(count, whole)}  {rest or ''}")
    for name, count in (*groups.items(), ("all", whole)):
        print(f"{name:30} {_shares(count, whole)}")
    print(dict(whole))


SMOOTH_KEY = "by smooth motions"
"""Key of the numbers tested without whole steps and shapes; these count as `tested` too."""


def _shares(count: Counter[str], whole: Counter[str]) -> str:
    """Format the numbers tested, in all and by smooth motions, and untested shares of the whole."""
    size, total = (one.total() - one[SMOOTH_KEY] for one in (count, whole))
    shares = (100 * (size - count[word]) / max(1, total) for word in ("tested", SMOOTH_KEY))
    untested = ", by smooth motions ".join(f"{share:.2f} %" for share in shares)
    smooth = f"by smooth motions {count[SMOOTH_KEY]:6}"
    return f"{count['tested']:6} of {size:6}, {smooth}; {untested} untested"


def main() -> None:
    """Run the selected campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("files", "faults", "acting", "tested"))
    parser.add_argument("paths", nargs="*", type=Path)
    parser.add_argument("--floating", action="store_true", help="free the root link of URDFs")
    parser.add_argument("--engine", default="", help="engine, such as mjx or drake")
    parser.add_argument("--each", type=int, default=4, help="numbers per attribute [4]")
    parser.add_argument("--kind", action="append", help="attribute whose numbers are changed [all]")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "files":
        print(dict(compare_files(options.paths, options.engine, floating=options.floating)))
    elif options.what == "tested":
        count_tested(options.paths, options.engine or "mujoco", floating=options.floating)
    elif options.what == "acting":
        count_acting(options.paths, floating=options.floating)
    else:
        kinds = options.kind or KINDS
        where = {"engine": options.engine, "floating": options.floating}
        count_faults(options.paths, options.each, options.seed, kinds, **where)


if __name__ == "__main__":
    main()

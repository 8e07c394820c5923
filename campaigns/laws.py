"""Whole steps by law: files of other people, random scenes, and planted faults.

`python -m campaigns.laws files FILE...` compares MJCFs in MuJoCo and URDFs in PyBullet, roots fixed
(`--floating`: free), with their laws.
`python -m campaigns.laws faults FILE... --each 8` changes numbers by 1e-6 and 1 %.
`python -m campaigns.laws tested FILE...` counts the tested numbers by kind.
"""

from __future__ import annotations

import argparse
import re
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.diagnosis.coverage import NumberEffect, counted_numbers
from physics_crosscheck.harness.diagnosis.law_problem import (
    AnyLawProblem,
    diagnose_laws,
    law_problem,
)
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.records.outcome import Outcome

RESOLUTION = 1e-9
SIZES = (1e-6, 1e-2)
KINDS = (
    "friction", "solref", "solimp", "solreflimit", "solimplimit", "solreffriction", "margin",
    "range", "frictionloss", "kp", "kv", "gainprm", "biasprm", "dynprm",
    "gear", "forcerange", "ctrlrange", "actuatorfrcrange", "polycoef", "anchor", "impratio",
    "timestep",
)  # fmt: skip
"""Attributes whose numbers are changed."""


def spec_of(file: Path, *, floating: bool = False) -> tuple[str, ModelSpec]:
    """Return the engine of a file, and what it loads."""
    if file.suffix != ".urdf":
        return "mujoco", ModelSpec(file)
    return "pybullet", ModelSpec(
        file, settings={**SETTINGS, **STANDALONE_SETTINGS, "floating": floating}
    )


def line(file: Path, *, floating: bool = False) -> tuple[str, str]:
    """Compare one file; return its outcome and a line of text."""
    began = time.process_time()
    engine, spec = spec_of(file, floating=floating)
    try:
        check = check_whole_step(file, spec, engine, RESOLUTION)
    except FileError as error:
        return "not loaded", f"{file.name}: {error.sentence[:100]}"
    assert check is not None
    record, judged = check.record, check.judgement
    if judged is None:
        reason = ", ".join(record.uncovered)
        return ("not covered", f"{file.name}: {reason}") if reason else ("no joint", file.name)
    acted = ", ".join(f"{term.count} {term.name}" for term in record.acted)
    sizes = f"E {judged.largest_discrepancy:.1e} U {judged.largest_uncertainty:.1e}"
    seconds = time.process_time() - began
    states = f"{record.states} states, {acted}; {seconds:.1f} s"
    return str(judged.outcome), f"{file.name}: {judged.outcome} {sizes}; {states}"


def files(paths: Iterable[Path], *, floating: bool = False) -> Counter[str]:
    """Compare files, and print a line for each."""
    counts = Counter[str]()
    for path in paths:
        outcome, text = line(path, floating=floating)
        counts[outcome] += 1
        print(text, flush=True)
    return counts


@dataclass(frozen=True, kw_only=True, eq=False)
class Sound:
    """A file that agrees with its law, and the effects of its numbers at the drawn states.

    Attributes:
        file: the model file.
        problem: its laws in the engine.
    """

    file: Path
    problem: AnyLawProblem

    @staticmethod
    def from_file(file: Path) -> Sound | None:
        """Return a file with its law; None without one."""
        problem = law_problem(model_task(prepare_tree(file, states=2), "mujoco"))
        agrees = problem is not None and problem.judge(RESOLUTION).outcome is Outcome.AGREES
        return Sound(file=file, problem=problem) if agrees and problem is not None else None

    def effect(self, index: int) -> float:
        """Return the largest relative effect of a number per unit; NaN if it is unknown."""
        problem = self.problem
        if index not in problem.numbers.law_numbers:
            return 0.0
        effect = problem.effect(problem.numbers.law_numbers.index(index))
        return float("nan") if effect is None else float(np.max(np.abs(effect), initial=0.0))

    def planted(self, index: int, value: float) -> Planted:
        """Load the file with another value of a number, compare and diagnose it."""
        numbers = self.problem.numbers
        number = numbers.numerals[index]
        others = numbers.texts({index: value})
        whole = number.file == self.file
        copy = number.file.with_name(f".laws-{number.file.name}")
        loaded = copy if whole else self.file
        acts = self.effect(index) * abs(value - number.value)
        original = number.file.read_bytes()
        target = copy if whole else number.file
        try:
            target.write_bytes(others[number.file])
            problem = self.problem.in_engine(replace(self.problem.spec, path=loaded))
        except FileError:
            return Planted(acts=acts, outcome="refused", named=False)
        finally:
            if whole:
                copy.unlink(missing_ok=True)
            else:
                number.file.write_bytes(original)
        outcome = str(problem.judge(RESOLUTION).outcome)
        named = outcome == "DIFFERS" and _names(problem, number.address)
        return Planted(acts=acts, outcome=outcome, named=named)


@dataclass(frozen=True, kw_only=True)
class Planted:
    """One planted fault.

    Attributes:
        acts: its largest effect by the law, relative.
        outcome: of the comparison.
        named: whether the diagnosis names the number, alone or among causes of equal effect.
    """

    acts: float
    outcome: str
    named: bool


def _names(problem: AnyLawProblem, address: str) -> bool:
    ranking = diagnose_laws(problem)
    if not (ranking.explained and ranking.fits):
        return False
    causes = (*ranking.fits[0].causes, *ranking.fits[0].tied_with)
    single = len(ranking.fits[0].causes) == 1
    return single and any(cause.subject == (address,) for cause in causes)


def planted(
    file: Path, each: int, rng: np.random.Generator, kinds: Collection[str] = KINDS
) -> Iterator[tuple[str, float, str, Planted]]:
    """Change numbers of a file; yield the attribute, the size, the address, and the result."""
    sound = Sound.from_file(file)
    if sound is None:
        print(file.name, "has no law that it agrees with")
        return
    groups: dict[str, list[int]] = {}
    for i, number in enumerate(sound.problem.numbers.numerals):
        if number.key in kinds and number.value and "/visual" not in number.path:
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each]:
            number = sound.problem.numbers.numerals[int(i)]
            for size in SIZES:
                fault = sound.planted(int(i), number.value * (1 + size))
                yield key, size, number.address, fault


def faults(paths: Iterable[Path], each: int, seed: int, kinds: Collection[str]) -> None:
    """Print, for each attribute and size, how many faults act, differ, and are named."""
    rng = np.random.default_rng(seed)
    counts: dict[tuple[str, float], Counter[str]] = {}
    for path in paths:
        for key, size, address, fault in planted(path, each, rng, kinds):
            count = counts.setdefault((key, size), Counter())
            acts = not fault.acts <= RESOLUTION
            caught = fault.outcome == "DIFFERS"
            count.update(planted=1, refused=fault.outcome == "refused", acts=acts)
            count.update(caught=acts and caught, named=acts and fault.named)
            if caught != acts or fault.named != caught:
                print(f"{path.name} {address} {size:g}: {fault}", flush=True)
    for (key, size), count in sorted(counts.items()):
        print(
            f"{key:18} {size:.0e}  planted {count['planted']:4}  acts {count['acts']:4}"
            f"  caught {count['caught']:4}  named {count['named']:4}"
        )
    total = sum(counts.values(), Counter[str]())
    print(dict(total))


NOT_DYNAMIC = re.compile(
    r".*/(visual|sensor|keyframe|statistic|size|custom|texture|material|camera|light)[/@].*"
    r"|.*@(rgba|group|texrepeat|texuniform|reflectance|shininess|specular|user|cutoff)"
)
"""Numbers that are no dynamics by their kind."""


def kind_of(path: str) -> str:
    """Return the element and attribute of a number, such as `joint@range`."""
    return path.rpartition("/")[2]


def tested(paths: Iterable[Path]) -> None:
    """Print the tested share of the numbers that dynamics may depend on, by kind.

    An overwritten default, or the position of a joint along its axis, has no effect at all.
    """
    totals: dict[str, Counter[str]] = {}
    for path in paths:
        began = time.process_time()
        try:
            task = model_task(prepare_tree(path), "mujoco")
            counted = counted_numbers(task, robot_numbers(path, task.spec.settings))
        except FileError as error:
            print(f"{path.name}: {error.sentence[:100]}")
            continue
        file = Counter[str]()
        for one in counted:
            if NOT_DYNAMIC.fullmatch(one.path):
                continue
            seen = one.bound or one.effect in (NumberEffect.MOTION, NumberEffect.FRAMES)
            word = "tested" if seen else one.effect.value
            file[word] += 1
            totals.setdefault(kind_of(one.path), Counter())[word] += 1
        seconds = time.process_time() - began
        print(f"{path.parent.name}/{path.name}: {dict(file)}, {seconds:.0f} s", flush=True)
    for kind, count in sorted(totals.items(), key=lambda item: -item[1].total()):
        rest = {word: number for word, number in count.items() if word != "tested"}
        print(f"{kind:30} {count['tested']:6} of {count.total():6}  {rest or ''}")
    whole = sum(totals.values(), Counter[str]())
    print(f"{whole['tested']} of {whole.total()}: {100 * whole['tested'] / whole.total():.1f} %")
    print(dict(whole))


def main() -> None:
    """Run one of the campaigns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("files", "faults", "tested"))
    parser.add_argument("paths", nargs="*", type=Path)
    parser.add_argument("--floating", action="store_true")
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--kind", action="append", help="attributes whose numbers are changed")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "files":
        print(dict(files(options.paths, floating=options.floating)))
    elif options.what == "tested":
        tested(options.paths)
    else:
        faults(options.paths, options.each, options.seed, options.kind or KINDS)


if __name__ == "__main__":
    main()

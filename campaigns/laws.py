"""Whole steps by law: files of other people, random scenes, and planted faults.

`python -m campaigns.laws files FILE...` compares MJCFs in MuJoCo and URDFs in PyBullet, roots fixed
(`--floating`: free), with their laws.
`python -m campaigns.laws scenes --count 2000` draws bodies on a plane and on each other.
`python -m campaigns.laws faults FILE... --each 8` changes numbers by 1e-6 and 1 %.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.modelfiles.numbers import numerals, with_values
from physics_crosscheck.harness.records.outcome import Outcome

RESOLUTION = 1e-9
SIZES = (1e-6, 1e-2)
KINDS = (
    "friction", "solref", "solimp", "solreflimit", "solimplimit", "solreffriction", "margin",
    "range", "frictionloss", "armature", "damping", "kp", "kv", "gainprm", "biasprm", "dynprm",
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


def scene(rng: np.random.Generator) -> str:
    """Draw a scene: bodies on a plane and on each other, and an arm at its limits."""
    numbers = " ".join
    pick = rng.choice

    def soft() -> str:
        reference = (
            f"{-rng.uniform(200, 3000):.6g} {-rng.uniform(5, 80):.6g}"
            if rng.uniform() < 0.3
            else f"{rng.uniform(0.004, 0.1):.6g} {rng.uniform(0.3, 1.5):.6g}"
        )
        impedance = numbers(
            f"{x:.6g}"
            for x in (*np.sort(rng.uniform(0.1, 0.99, 2)), rng.uniform(0, 0.02),
                      rng.uniform(0.1, 0.9), rng.uniform(1, 4))
        )  # fmt: skip
        return f'solref="{reference}" solimp="{impedance}"'

    def surface() -> str:
        friction = (
            f"{rng.uniform(0, 1.2):.6g} {rng.uniform(0, 0.05):.6g} {rng.uniform(0, 0.02):.6g}"
        )
        margin = rng.uniform(0, 0.003) * (rng.uniform() < 0.5)
        priority, mix = pick([0, 0, 0, 1]), rng.uniform(0, 3)
        return (
            f'condim="{pick([1, 3, 4, 6])}" friction="{friction}" margin="{margin:.6g}"'
            f' priority="{priority}" solmix="{mix:.6g}" {soft()}'
        )

    def body(k: int) -> str:
        kind = pick(["sphere", "box", "capsule"])
        size = rng.uniform(0.04, 0.12, {"sphere": 1, "box": 3, "capsule": 2}[kind])
        height = {"sphere": size[0], "box": size[-1], "capsule": size.sum()}[kind]
        place = rng.uniform(-0.15, 0.15, 2)
        up = height + 0.15 * (k // 2) - rng.uniform(0, 0.004)
        return (
            f'<body pos="{place[0]:.6g} {place[1]:.6g} {up:.6g}"><freejoint/>'
            f'<geom type="{kind}" size="{numbers(f"{x:.6g}" for x in size)}"'
            f' mass="{rng.uniform(0.2, 3):.6g}" {surface()}/></body>'
        )

    limit = soft().replace("solref", "solreflimit").replace("solimp", "solimplimit")
    arm = (
        f'<body pos="0.6 0 0.3"><joint name="a" axis="0 1 0" range="-20 {rng.uniform(0, 30):.6g}"'
        f' frictionloss="{rng.uniform(0, 1):.6g}" damping="{rng.uniform(0, 1):.6g}" {limit}/>'
        f'<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1" {surface()}/></body>'
    )
    integrator = pick(["Euler", "implicitfast", "implicit"])
    options = (
        f'timestep="{pick([0.001, 0.002, 0.005])}" integrator="{integrator}"'
        f' cone="{pick(["pyramidal", "elliptic"])}" impratio="{pick([1, 1, 3, 10])}"'
    )
    servo = (
        f'<position joint="a" kp="{rng.uniform(5, 80):.6g}" kv="{rng.uniform(0, 5):.6g}"'
        f' forcerange="-{rng.uniform(1, 9):.6g} 5" ctrlrange="-1 1"/>'
    )
    bodies = "".join(body(k) for k in range(int(rng.integers(1, 5))))
    return (
        f"<mujoco><option {options}/><worldbody>"
        f'<geom type="plane" size="5 5 .1" {surface()}/>{bodies}{arm}</worldbody>'
        f"<actuator>{servo}</actuator></mujoco>"
    )


def scenes(count: int, seed: int) -> Counter[str]:
    """Compare random scenes; print those that do not agree, and the largest E/U that counts."""
    rng, counts, largest = np.random.default_rng(seed), Counter[str](), 0.0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.xml"
        for k in range(count):
            file.write_text(scene(rng))
            check = check_whole_step(file, ModelSpec(file), "mujoco", RESOLUTION)
            assert check is not None
            judged = check.judgement
            assert judged is not None
            counts[str(judged.outcome)] += 1
            largest = max(largest, judged.largest_discrepancy)
            if judged.outcome is not Outcome.AGREES:
                print(k, check.record.component, judged, flush=True)
                Path(f"scene-{seed}-{k}.xml").write_text(file.read_text())
    print(f"largest E {largest:.1e}")
    return counts


def planted(file: Path, each: int, rng: np.random.Generator) -> Iterator[tuple[str, float, str]]:
    """Change numbers of a file; yield the attribute, the size, and what the check says."""
    document = Document(file)
    rows = numerals(document)
    groups: dict[str, list[int]] = {}
    for i, number in enumerate(rows):
        if number.key in KINDS and number.value and "/visual" not in number.path:
            groups.setdefault(number.key, []).append(i)
    for key, members in groups.items():
        for i in rng.permutation(members)[:each]:
            for size in SIZES:
                changed = {int(i): rows[i].value * (1 + size)}
                copy = file.with_name(f".laws-{file.name}")
                copy.write_bytes(with_values(document.data, rows, changed))
                try:
                    check = check_whole_step(file, ModelSpec(copy), "mujoco", RESOLUTION)
                    done = check is not None and check.judgement is not None
                    yield key, size, str(check.judgement.outcome) if done else "not compared"  # type: ignore[union-attr]
                except FileError:
                    yield key, size, "refused"
                finally:
                    copy.unlink()


def faults(paths: Iterable[Path], each: int, seed: int) -> None:
    """Print, for each attribute and size, how many changes differ."""
    rng = np.random.default_rng(seed)
    counts: dict[tuple[str, float], Counter[str]] = {}
    for path in paths:
        for key, size, outcome in planted(path, each, rng):
            counts.setdefault((key, size), Counter())[outcome] += 1
    for (key, size), outcomes in sorted(counts.items()):
        tried = sum(outcomes.values()) - outcomes["refused"]
        print(f"{key:18} {size:.0e}  {outcomes['DIFFERS']:4} of {tried:4} differ", dict(outcomes))


def main() -> None:
    """Run one of the three campaigns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("files", "scenes", "faults"))
    parser.add_argument("paths", nargs="*", type=Path)
    parser.add_argument("--floating", action="store_true")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "files":
        print(dict(files(options.paths, floating=options.floating)))
    elif options.what == "scenes":
        print(dict(scenes(options.count, options.seed)))
    else:
        faults(options.paths, options.each, options.seed)


if __name__ == "__main__":
    main()

"""Invented results for the report's tests, with every outcome and every field."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.records.base import Numbers, Rows, numbers
from physics_crosscheck.harness.records.case import (
    CheckedStep,
    Convergence,
    EnergySeries,
    ErrorDecomposition,
    StepErrors,
    TargetStep,
)
from physics_crosscheck.harness.records.diff import Diff, Status, bare_diff
from physics_crosscheck.harness.records.finding import CorrectedMotion, CorrectedScenario
from physics_crosscheck.harness.records.model import DiscreteLinearization, EnginePole
from physics_crosscheck.harness.records.results import BaselineChanges
from physics_crosscheck.harness.render.html.packs import Array
from physics_crosscheck.records import (
    Case,
    CauseId,
    Diagnosis,
    EngineLinearization,
    Explanation,
    Model,
    Outcome,
    Results,
    Series,
    SourceLine,
    SystemResult,
)
from tests.records import made

SCENARIOS = ("free", "driven", "large")
SAMPLES = 240
RUNGS = (2, 3, 5, 7, 11, 17, 29, 41)
ENGINES = (("mujoco.xml", "mujoco"), ("robot.urdf", "mujoco"), ("robot.urdf", "pybullet"))


def system(name: str, coordinates: int) -> SystemResult:
    """Return an invented system of one or two coordinates, as a run writes it."""
    text = Path(__file__).with_name(f"system_{coordinates}.json").read_text(encoding="utf-8")
    record = msgspec.json.decode(text, type=SystemResult)
    return replace(record, name=name, folder=f"/models/{name}", title=f"The {name}")


def pole(real: float, imaginary: float) -> EnginePole:
    size = abs(complex(real, imaginary))
    return EnginePole(real=real, imaginary=imaginary, frequency=size, damping=-real / size)


def model(name: str, file: str, engine: str, coordinates: int) -> Model:
    response = (((1.0,),) * coordinates, ((2.0,),) * coordinates)
    one_step = DiscreteLinearization(
        step=0.002, a=((0.999,),), b=((0.0,),), error=2e-13, bound=1e-12, differs=False,
        radius=0.999, exact_radius=0.9991,
    )  # fmt: skip
    linearization = EngineLinearization(
        equilibrium="rest", a=((0.0,),), b=((0.0,),), a_error=2.5e-14, a_bound=1e-11,
        b_error=3.5e-15, poles=(pole(-0.1, -3.0), pole(-0.1, 3.0003)),
        taylor_poles=(pole(-0.1, -3.0), pole(-0.1, 3.0)), transfer_error=None, mode_similarity=1.0,
        frequencies=(1.0, 2.0), response=response, taylor_response=response, one_step=one_step,
    )  # fmt: skip
    text = f"<{file}/>\n" + "\n".join(f"  <line n='{i}'/>" for i in range(2, 41))
    return made.model(
        system=name, model=file, engine=engine, folder=f"/models/{name}", text=text,
        linearizations=(linearization,),
    )  # fmt: skip


def case(name: str, file: str, engine: str, scenario: str, coordinates: int) -> Case:
    seed = [ord(c) for c in name + file + engine + scenario]
    verdict = made.verdict(
        discrepancy=7.1e-14, uncertainty=1.02e-12, component="q0", time=1.1,
        largest_discrepancy=7.1e-14, largest_uncertainty=1.02e-12, order=1.002, rungs=RUNGS,
        steps=48185,
    )  # fmt: skip
    full_run = made.full_run(
        integrator="euler", global_error=0.00911, order=1.001, residual=1e-6,
        decomposition=ErrorDecomposition(
            amplitude=-0.029, phase=-0.068, frequency=4.6e-4, damping=2.3e-4, explained=0.97
        ),
        steps_for=(TargetStep(target=0.01, step=0.0021), TargetStep(target=0.001, step=None)),
        checked_step=CheckedStep(target=0.01, step=0.0021, measured=0.00957), energy_error=0.0068,
    )  # fmt: skip
    return made.case(
        system=name, model=file, scenario=scenario, engine=engine, folder=f"/models/{name}",
        seconds=0.8, verdict=verdict, full_run=full_run,
        series=series(np.random.default_rng(seed), coordinates),
    )  # fmt: skip


def row(values: Array, digits: int) -> Numbers:
    return tuple(float(f"{value:.{digits}g}") for value in values.tolist())


def grid(values: Array, digits: int) -> Rows:
    return tuple(row(one, digits) for one in values)


def series(random: np.random.Generator, coordinates: int) -> Series:
    t = np.linspace(0.0, 12.0, SAMPLES)
    size = 2 * coordinates
    names = [f"q{i}" for i in range(coordinates)]
    reference = np.sin(np.outer(np.arange(1, size + 1), t))
    error = 0.01 * random.normal(size=reference.shape)
    error[:, 0] = 0.0
    h = 0.04 / np.array(RUNGS)
    return Series(
        t=row(t, 7),
        components=(*names, *(f"{n}_dot" for n in names)),
        reference=grid(reference, 6),
        engine=grid(reference + error, 6),
        error=grid(error, 4),
        segment_t=row(t, 6),
        defect=grid(1e-14 * random.normal(size=reference.shape), 3),
        defect_uncertainty=grid(1e-12 * random.uniform(1, 2, size=reference.shape), 3),
        convergence=Convergence(
            rungs=RUNGS,
            h=row(h, 6),
            defect=row(0.3 * h, 4),
            increments=row(10.0 ** -np.arange(1.0, len(RUNGS)), 4),
        ),
        full_runs=StepErrors(
            h=(0.002, 0.001, 0.004), error=(0.0091, 0.0045, 0.019), seconds=(0.11, 0.23, 0.06)
        ),
        energy=EnergySeries(
            held=row(np.sin(t), 5), supplied=row(np.sin(t) + 0.01, 5), dissipated=row(0.01 * t, 5)
        ),
    )


def results(systems: int = 2) -> Results:
    """Return agreeing results; systems alternate between one and two coordinates."""
    sizes = {f"system_{i}": 1 + i % 2 for i in range(systems)}
    runs = [(name, *pair) for name in sizes for pair in ENGINES]
    return Results(
        created="2026-11-21T02:19:33+00:00",
        resolution=1e-9,
        seconds=37.4,
        versions={
            "physics-crosscheck": "0.1.0",
            "python": "3.11.7",
            "mujoco": "4.0.0",
            "pybullet": None,
        },
        systems=tuple(system(name, size) for name, size in sizes.items()),
        models=tuple(model(*run, sizes[run[0]]) for run in runs),
        cases=tuple(case(*run, s, sizes[run[0]]) for run in runs for s in SCENARIOS),
    )


def unjudged(case: Case, outcome: Outcome, reason: str, stdout: str = "") -> Case:
    names = {name: getattr(case, name) for name in ("system", "model", "scenario", "engine")}
    return Case(**names, folder=case.folder, outcome=outcome, reason=reason, stdout=stdout)


def judged(case: Case, outcome: Outcome, reason: str, **verdict: Any) -> Case:
    assert case.verdict is not None
    return replace(case, outcome=outcome, reason=reason, verdict=replace(case.verdict, **verdict))


def changed_case(base: Results, place: int, **fields: Any) -> Results:
    cases = list(base.cases)
    cases[place] = replace(cases[place], **fields)
    return replace(base, cases=tuple(cases))


def changed_model(base: Results, place: int, **fields: Any) -> Results:
    models = list(base.models)
    models[place] = replace(models[place], **fields)
    return replace(base, models=tuple(models))


def series_of(case: Case) -> Series:
    assert case.series is not None
    return case.series


def array(values: Numbers) -> Array:
    """Return numbers as an array, with nan for missing ones."""
    return np.array(values, dtype=float)


LITERAL = CauseId(kind="literal", subject=("joint[x]@stiffness",))
CONSTANT = CauseId(kind="constant", subject=("k",))
MASS = CauseId(kind="constant", subject=("mass",))


def explanation(
    cause: CauseId, remaining: float, tied: tuple[CauseId, ...] = (), where: str = ""
) -> Explanation:
    shown = made.cause(
        *cause.subject, kind=cause.kind, nominal=38.25, estimate=39.5, standard_error=1e-9,
        locations=(SourceLine(file=where, line=21),) if where else (),
    )  # fmt: skip
    return Explanation(causes=(shown,), remaining=remaining, tied_with=tied)


def diagnosis(case: Case) -> Diagnosis:
    """Return a wrong literal with its line, a constant tied with it, and the residuals."""
    case_series = series_of(case)
    size = len(case_series.components)
    by_constant = explanation(CONSTANT, 1.1e-10, (LITERAL,))
    return Diagnosis(
        explained=True,
        floor=1e-9,
        seconds=2.0,
        explanations=(
            explanation(LITERAL, 1e-10, (CONSTANT,), case.model),
            by_constant,
            explanation(MASS, 0.4),
        ),
        corrected=CorrectedMotion(
            causes=by_constant.causes,
            put_into="equations",
            scenarios=(
                CorrectedScenario(
                    scenario=case.scenario,
                    t=case_series.t,
                    corrected=case_series.engine,
                    segment_t=row(np.linspace(0.2, 11.8, 24), 6),
                    before=((3.1e-6,) * 24,) * size,
                    after=((2e-14,) * 24,) * size,
                ),
            ),
        ),
    )


STIFFNESS = '  <joint name="x" stiffness="38.25" damping="0.5"/>'


def planted(engines: Sequence[str] = ("mujoco", "pybullet")) -> Results:
    """Return results with one wrong number: its file differs in each run, others agree."""
    sample = results(2)
    lines = sample.models[0].text.splitlines()
    text = "\n".join([*lines[:20], STIFFNESS, *lines[21:]]) + "\n"
    base = {1: sample.models[0], 2: sample.models[3]}
    models, cases = [], []
    for name, base_model in base.items():
        for file in ("mujoco.xml", "robot.urdf"):
            for engine in engines:
                models.append(replace(base_model, model=file, engine=engine, text=text))
                model_cases = [c for c in sample.cases if c.key == base_model.key]
                for each in model_cases:
                    run = replace(each, model=file, engine=engine)
                    if (name, file) == (1, "robot.urdf"):
                        run = judged(
                            run, Outcome.DIFFERS, "q0 ends 3.1e-02 off", discrepancy=3.1e-2,
                            largest_discrepancy=3.1e-2,
                        )  # fmt: skip
                    cases.append(run)
    wrong = {model.key for model in models} & {
        case.key for case in cases if case.outcome is Outcome.DIFFERS
    }
    diagnoses = {case.key: diagnosis(case) for case in cases if case.key in wrong}
    models = [
        replace(model, diagnosis=spelled(diagnoses[model.key], text))
        if model.key in diagnoses
        else replace(model, diagnosis=None)
        for model in models
    ]
    return replace(sample, models=tuple(models), cases=tuple(cases))


def spelled(original: Diagnosis, text: str) -> Diagnosis:
    """Return a diagnosis whose first cause has its byte range in the file."""
    first, *rest = original.explanations
    (cause,) = first.causes
    cause = replace(cause, locations=(located(cause.locations[0], text, "38.25"),))
    return replace(original, explanations=(replace(first, causes=(cause,)), *rest))


def located(where: SourceLine, text: str, number: str) -> SourceLine:
    """Return a line with the byte range of a number that occurs once in a text."""
    start = text.encode().index(number.encode())
    return replace(where, span=(start, start + len(number.encode())), text=number)


def blown_up(case: Case) -> Case:
    """Return a case whose full run diverges."""
    assert case.full_run is not None

    def lost(values: Rows) -> Rows:
        growing = [10.0 ** (4 * i) for i in range(20)]
        return tuple(numbers([*one[:80], *growing, *[None] * len(one[100:])]) for one in values)

    case_series = series_of(case)
    return replace(
        case,
        outcome=Outcome.FAILED,
        reason="no longer finite",
        full_run=replace(case.full_run, global_error=None, decomposition=None),
        series=replace(case_series, engine=lost(case_series.engine), error=lost(case_series.error)),
    )


def mixed() -> Results:
    """Return a case of each outcome, a diverged one, and an unreadable folder."""
    sample = results()
    cases = list(sample.cases)
    wrong = 3.1e-6
    unread = unjudged(cases[5], Outcome.FAILED, "/models/unread/system.py: line 3: no unit")
    off = {"discrepancy": wrong, "largest_discrepancy": wrong}
    cases[0] = judged(cases[0], Outcome.DIFFERS, "q0 ends 3.1e-06 off", **off)
    unknown = {"uncertainty": None, "largest_uncertainty": None, "order": None}
    cases[1] = judged(cases[1], Outcome.UNRESOLVED, "exponents", **unknown)
    cases[2] = unjudged(cases[2], Outcome.ABSENT, "pybullet is not installed")
    cases[3] = unjudged(cases[3], Outcome.FAILED, "the engine's process died", "Segmentation fault")
    cases[4] = blown_up(cases[4])
    cases[5] = replace(cases[5], accepted="the vendor knows")
    cases.append(
        replace(unread, system="unread", folder="/models/unread", engine="-", scenario="-")
    )
    cases.append(unjudged(replace(cases[3], engine="drake"), Outcome.REFUSED, "a massless link"))
    audited = made.finding(
        "joint[x]@stiffness is 39.5 where k = 38.25", subject=("joint[x]@stiffness",),
        location=SourceLine(file="/models/system_0/mujoco.xml", line=21), expected=38.25,
        actual=39.5,
    )  # fmt: skip
    models = list(sample.models)
    models[0] = replace(models[0], diagnosis=diagnosis(cases[0]), audit=(audited,))
    models[1] = replace(models[1], linearizations=(), linearization_failure="it diverges")
    return replace(
        sample,
        # A system without a sketch.
        systems=(sample.systems[0], replace(sample.systems[1], sketch=None)),
        models=tuple(models),
        cases=tuple(cases),
        baseline=BaselineChanges(name="baseline.json", changes=(change(cases[0]),)),
    )


def change(case: Case) -> Diff:
    return bare_diff(case.id, Status.CHANGED, ("it agreed to 11.9 digits",))

"""Benchmarks, as ratios within one run: `make bench`.

1. Segments, over a hand-written loop of the same engine, steps and states.
2. Engine steps to certify a trajectory to 1e-9, over those of plain refinement.
3. All built-in cases: two workers over one.
4. Reports of these cases, of 2 000 and of 10 000: size, time to write, and times in a browser.
5. `compare` of two files of an arm with seven joints: processor time and discrepancies.
6. Each installed engine: microseconds of a step and of a state, over a bare loop.
7. Time to certify 1e-6 and 1e-9, over a script of `solve_ivp` and `allclose`.
8. Whole steps compared with MuJoCo's law: processor time of a state, over a step of MuJoCo.

`ratios.json` keeps the ratios by version. The last lines list those that grew.
"""

from __future__ import annotations

import importlib.util
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from msgspec.structs import replace
from rich.console import Console
from rich.table import Table

from benchmarks.bench_by_hand import by_hand_ratios
from benchmarks.bench_engines import costs_of_engines
from benchmarks.bench_laws import law_ratios
from benchmarks.bench_robots import robots
from benchmarks.bench_segments import certification, overhead
from benchmarks.ratios import current_version, store
from physics_crosscheck.harness.commands.compare.candidate import candidate
from physics_crosscheck.harness.commands.compare.compare import CompareOptions, compare
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.system import SystemResult
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.run import Options, run
from tests.report.chromium import CHROMIUM, running

REPEATS = 5


def multiplied(results: Results, times: int) -> Results:
    """Repeat the systems of results under other names."""
    systems: list[SystemResult] = []
    models: list[Model] = []
    cases: list[Case] = []
    for i in range(times):
        systems += [
            replace(system, folder=f"{system.folder}_{i}", name=f"{system.name}_{i}")
            for system in results.systems
        ]
        models += [replace(model, **renamed(model, i)) for model in results.models]
        cases += [replace(case, **renamed(case, i)) for case in results.cases]
    return replace(results, systems=tuple(systems), models=tuple(models), cases=tuple(cases))


def renamed(record: Model | Case, i: int) -> dict[str, str]:
    return {"folder": f"{record.folder}_{i}", "system": f"{record.system}_{i}"}


def report(console: Console, results: Results) -> None:
    table = Table(
        "cases",
        "page",
        "data files",
        "written in",
        "usable after",
        "case page after",
        "filtered in",
        "sorted in",
        title="Report",
    )
    for cases in (1, 2_000, 10_000):
        larger = multiplied(results, math.ceil(cases / len(results.cases)))
        # A browser that ends may still write its profile.
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "index.html"
            began = time.perf_counter()
            write_report(path, larger)
            written = time.perf_counter() - began
            size = path.stat().st_size / 1e6
            scripts = sum(file.stat().st_size for file in Path(folder).glob("*/*.js")) / 1e6
            waits = browser_times(path) if CHROMIUM else ("no browser",) * 4
        sizes = f"{size:.1f} MB", f"{scripts:.0f} MB"
        table.add_row(str(len(larger.cases)), *sizes, f"{written:.1f} s", *waits)
    console.print(table)


FILTER = """(() => {
  const began = performance.now();
  const field = document.getElementById("search");
  field.value = "pybullet";
  field.dispatchEvent(new Event("input"));
  document.body.offsetHeight;
  return (performance.now() - began) / 1000;
})()"""


SORT = """(() => {
  const began = performance.now();
  document.querySelector("#cases th[data-kind=number] button").click();
  document.body.offsetHeight;
  return (performance.now() - began) / 1000;
})()"""


def browser_times(path: Path) -> tuple[str, ...]:
    """Median times in a browser: until usable, a case drawn, the list filtered, and sorted."""
    usable, opened, filtered, sorted_in = [], [], [], []
    with running(path.parent) as browser:
        for _ in range(REPEATS):
            with browser.tab() as tab:
                began = time.perf_counter()
                tab.open(path.as_uri())
                usable.append(time.perf_counter() - began)
                began = time.perf_counter()
                tab.go(tab.run("document.querySelector('#cases tbody a').hash.slice(1)"))
                tab.until("document.querySelector('.view.current [data-drawn]')")
                opened.append(time.perf_counter() - began)
                tab.go("overview")
                filtered.append(tab.run(FILTER))
                sorted_in.append(tab.run(SORT))
    waits = (usable, opened, filtered, sorted_in)
    return tuple(f"{statistics.median(times):.2f} s" for times in waits)


def matrix(console: Console) -> Results:
    folders = system_folders([])
    times = {}
    for jobs in (1, 2):
        began = time.perf_counter()
        results = run(folders, Options(jobs=jobs), lambda *_: None).results
        times[jobs] = time.perf_counter() - began
    worked = {"derive, linearize, solve": sum(system.seconds for system in results.systems)}
    worked["run and judge cases"] = sum(case.seconds for case in results.cases)
    console.print(
        f"whole matrix, {len(results.cases)} cases: one worker {times[1]:.1f} s, two"
        f" {times[2]:.1f} s, ratio {times[2] / times[1]:.2f}"
    )
    for phase, seconds in worked.items():
        console.print(f"  {phase}: {seconds:.1f} s of worker time")
    by_engine: dict[str, float] = {}
    for case in results.cases:
        by_engine[case.engine] = by_engine.get(case.engine, 0.0) + case.seconds
    for engine, seconds in sorted(by_engine.items()):
        console.print(f"    {engine}: {seconds:.1f} s")
    return results


def comparisons(console: Console) -> None:
    """Compare PyBullet's kuka in two engines, and with a mass that is off by 1e-6."""
    data = importlib.util.find_spec("pybullet_data")
    if data is None or data.origin is None:
        console.print("no arm to compare: pybullet_data is not installed")
        return
    path = Path(data.origin).parent / "kuka_iiwa" / "model.urdf"
    table = Table(
        "B", "outcome", "discrepancy", "uncertainty", "causes", "processor time", title="compare"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = "import physics_crosscheck.harness.interfaces.cli.compare"
    subprocess.run([sys.executable, "-c", code], check=True)  # this interpreter
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "off.urdf"
        other.write_text(path.read_text().replace('"1.8"', '"1.8000018"', 1))
        for b, engine in ((path, "mujoco"), (other, "mujoco"), (other, "pybullet")):
            began = time.process_time()
            pair = CompareOptions(a=candidate("A", path, "pybullet"), b=candidate("B", b, engine))
            comparison = compare(pair, InThisProcess())
            compared = comparison.compared
            assert compared is not None
            table.add_row(
                f"{b.name} in {engine}",
                str(comparison.outcome),
                f"{compared.discrepancy:.1e}",
                f"{compared.uncertainty:.1e}",
                "; ".join(cause.message for cause in compared.properties) or "nothing",
                f"{time.process_time() - began:.2f} s",
            )
    console.print(table)
    start = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    console.print(f"start-up of the command and of its worker: {start:.2f} s each")


def main() -> None:
    console = Console(width=140)
    comparisons(console)
    costs_of_engines(console)
    robots(console)
    ratios = {**by_hand_ratios(console), **overhead(console), **certification(console)}
    ratios.update(law_ratios(console))
    for line in store(ratios, current_version()):
        console.print(line)
    report(console, matrix(console))


if __name__ == "__main__":
    main()

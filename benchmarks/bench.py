"""Benchmarks, as ratios within one run: `make bench`.

1. The harness's time for a scenario's ladder against a hand-written loop of the same engine that
   does the same steps from the same states.
2. Engine steps to certify a trajectory to 1e-9 against the steps that plain refinement would need.
3. The whole matrix with two workers against one.
4. The report of it, and those of two and of ten thousand cases: size of the page, and of the files
   beside it, time to draw it up, and in a headless Chromium until it can be used, until a case's
   first plots are drawn, and until the list is filtered and sorted.
5. Two files of an arm of seven joints held against each other: processor time, and discrepancies.
6. Each engine that is installed: microseconds a step and a state, beside a bare loop.
7. The time to certify 1e-6 and 1e-9 against a script of `solve_ivp` and `allclose`.

Ratios are kept by version in `ratios.json`, and what became slower is told.
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

from benchmarks.bench_by_hand import compared
from benchmarks.bench_engines import costs_of_engines
from benchmarks.bench_robots import robots
from benchmarks.bench_segments import certification, overhead
from benchmarks.lasting import keep, this_version
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


def multiplied(found: Results, times: int) -> Results:
    """The same results with each system several times, under other names."""
    systems: list[SystemResult] = []
    models: list[Model] = []
    cases: list[Case] = []
    for i in range(times):
        systems += [
            replace(one, folder=f"{one.folder}_{i}", name=f"{one.name}_{i}")
            for one in found.systems
        ]
        models += [replace(one, **renamed(one, i)) for one in found.models]
        cases += [replace(one, **renamed(one, i)) for one in found.cases]
    return replace(found, systems=tuple(systems), models=tuple(models), cases=tuple(cases))


def renamed(one: Model | Case, i: int) -> dict[str, str]:
    return {"folder": f"{one.folder}_{i}", "system": f"{one.system}_{i}"}


def report(console: Console, found: Results) -> None:
    table = Table(
        "cases",
        "page",
        "beside it",
        "drawn up in",
        "usable after",
        "a case's first plots after",
        "filtered in",
        "sorted in",
        title="Report",
    )
    for cases in (1, 2_000, 10_000):
        times = math.ceil(cases / len(found.cases))
        results = multiplied(found, times)
        # A browser that ends may still write its profile.
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "index.html"
            began = time.perf_counter()
            write_report(path, results)
            drawn_up = time.perf_counter() - began
            size = path.stat().st_size / 1e6
            beside = sum(one.stat().st_size for one in Path(folder).glob("*/*.js")) / 1e6
            seen = looked_at(path) if CHROMIUM else ("no browser",) * 4
        sizes = f"{size:.1f} MB", f"{beside:.0f} MB"
        table.add_row(str(len(results.cases)), *sizes, f"{drawn_up:.1f} s", *seen)
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


def looked_at(path: Path) -> tuple[str, ...]:
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
    seen = (usable, opened, filtered, sorted_in)
    return tuple(f"{statistics.median(times):.2f} s" for times in seen)


def matrix(console: Console) -> Results:
    folders = system_folders([])
    times = {}
    for jobs in (1, 2):
        began = time.perf_counter()
        found = run(folders, Options(jobs=jobs), lambda *_: None).results
        times[jobs] = time.perf_counter() - began
    worked = {"derive, linearize, solve": sum(system.seconds for system in found.systems)}
    worked["run and judge cases"] = sum(case.seconds for case in found.cases)
    console.print(
        f"whole matrix, {len(found.cases)} cases: one worker {times[1]:.1f} s, two"
        f" {times[2]:.1f} s, ratio {times[2] / times[1]:.2f}"
    )
    for what, seconds in worked.items():
        console.print(f"  {what}: {seconds:.1f} s of worker time")
    by_engine: dict[str, float] = {}
    for case in found.cases:
        by_engine[case.engine] = by_engine.get(case.engine, 0.0) + case.seconds
    for engine, seconds in sorted(by_engine.items()):
        console.print(f"    {engine}: {seconds:.1f} s")
    return found


def comparisons(console: Console) -> None:
    """Of PyBullet's kuka: as it is in two engines, and with one mass off by a millionth."""
    data = importlib.util.find_spec("pybullet_data")
    if data is None or data.origin is None:
        console.print("no arm to compare: pybullet_data is not installed")
        return
    path = Path(data.origin).parent / "kuka_iiwa" / "model.urdf"
    table = Table("B", "outcome", "discrepancy", "uncertainty", "told", "work", title="compare")
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
            found = comparison.compared
            assert found is not None
            table.add_row(
                f"{b.name} in {engine}",
                str(comparison.outcome),
                f"{found.discrepancy:.1e}",
                f"{found.uncertainty:.1e}",
                "; ".join(one.message for one in found.properties) or "nothing",
                f"{time.process_time() - began:.2f} s",
            )
    console.print(table)
    start = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    console.print(f"beside the work the command and its worker start, {start:.2f} s each")


def main() -> None:
    console = Console(width=140)
    comparisons(console)
    costs_of_engines(console)
    robots(console)
    ratios = {**compared(console), **overhead(console), **certification(console)}
    for line in keep(ratios, this_version()):
        console.print(line)
    report(console, matrix(console))


if __name__ == "__main__":
    main()

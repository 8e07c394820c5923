"""Robot files drawn from public repositories, each run as a user runs it.

`python -m campaigns.real_models CLONES --seed 1` draws files from the repositories in a
folder, and runs `crosscheck run FILE` on each. A repository of `REPOSITORIES` that is missing there
can be cloned by `--clone`. Results are kept in a file, and the tables count all kept results of
the draw: SDFormat needs another environment than URDF, so `--formats` selects what runs now.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import msgspec

from campaigns.real_models.files import included_paths, robot_files
from physics_crosscheck.harness.records.base import Number, Record
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import ResultsError, read_results

REPOSITORIES = Path(__file__).with_name("repositories.txt")
"""Names of public repositories of GitHub with robot files."""

TURNS = ("urdf", "xacro", "mjcf", "urdf", "sdf", "urdf", "xacro", "mjcf")
"""The formats in the order in which a draw takes files."""

LOADERS = {
    "mujoco": ("urdf xacro mjcf", "import mujoco; mujoco.MjModel.from_xml_path(f)"),
    "pybullet": ("urdf xacro", "import pybullet as p; p.connect(p.DIRECT); p.loadURDF(f)"),
    "pinocchio": (
        "urdf xacro mjcf",
        "import pinocchio as p; (p.buildModelFromMJCF if f[-3:] == 'xml' else"
        " p.buildModelFromUrdf)(f)",
    ),
    "drake": (
        "sdf",
        "from pydrake.all import MultibodyPlant, Parser; plant = MultibodyPlant(0.001);"
        " Parser(plant).AddModels(f); plant.Finalize()",
    ),
    "dart": ("sdf", "import dartpy; assert dartpy.utils.SdfParser.readSkeleton(f) is not None"),
}
"""For each engine, formats and code that loads a file `f` without this program."""

EXAMPLES = 4
"""Largest number of file names after a reason."""

SAME = 1e-12
"""Largest difference of equal mass matrices."""

_MOVES = re.compile(rb"<(joint|freejoint|include)\b")
"""Content of a file that may move; buildings and signs are not drawn."""

_USED = re.compile(r"<link\b|<xacro:(?!macro|include|property|arg|if|unless)")
"""Content, outside of macros, of a source that is a robot and not a part of others."""

_EXPAND = (
    "from pathlib import Path; from physics_crosscheck.harness.documents.expanded import expand;"
    " f = str(expand(Path(f))); "
)


class DrawnFile(Record, frozen=True, kw_only=True):
    """The result of a drawn file.

    Attributes:
        file: its path below the folder of clones.
        format: urdf, xacro, mjcf or sdf.
        code: exit code of `crosscheck run`; negative for a signal, -9 at the time limit.
        seconds: processor time, also of its workers.
        outcomes: outcome by engine.
        reasons: `outcome engine code: reason` of each case that does not agree, and its causes.
        loading: engines that load the file by themselves.
        mass: difference of the reference's mass matrix from an independent one; None without one.
        is_static: whether its outcome is that nothing moves.
    """

    file: str
    format: str
    code: int
    seconds: float
    outcomes: Mapping[str, Outcome]
    reasons: tuple[str, ...]
    loading: tuple[str, ...]
    mass: Number = None
    is_static: bool = False

    @property
    def has_verdict(self) -> bool:
        """True if at least one engine agrees or differs, or nothing in the file moves."""
        return self.is_static or bool(
            {Outcome.AGREES, Outcome.DIFFERS} & set(self.outcomes.values())
        )


def clone(folder: Path) -> None:
    """Clone the repositories that are missing in a folder; report those without a clone."""
    for name in REPOSITORIES.read_text().split():
        into = folder / name.replace("/", "+")
        command = ["git", "clone", "--depth", "1", f"https://github.com/{name}", str(into)]
        if not into.exists() and subprocess.run(command, check=False).returncode:
            print(f"{name}: not cloned", flush=True)


def files_of(repository: Path) -> Iterator[tuple[str, Path]]:
    """Yield the robot files of a repository with their formats; no part of another file."""
    files = [one for one in robot_files(repository) if one.is_file()]
    parts = included_paths(files)
    for file in files:
        if _MOVES.search(file.read_bytes()) and str(file.resolve()) not in parts:
            yield "urdf" if file.suffix == ".urdf" else "mjcf", file
    sources = {file: file.read_text(errors="replace") for file in repository.rglob("*.xacro")}
    includes = r"<xacro:include[^>]*?filename\s*=\s*[\"'][^\"']*?([^\"'/]+)[\"']"
    included = {name for text in sources.values() for name in re.findall(includes, text)}
    for file, text in sorted(sources.items()):
        robot = _USED.search(re.sub(r"(?s)<xacro:macro.*?</xacro:macro>|<!--.*?-->", "", text))
        if robot and "<robot" in text and ".srdf" not in file.name and file.name not in included:
            yield "xacro", file
    for file in sorted(repository.rglob("*.sdf")):
        data = file.read_bytes()
        if b"<sdf" in data and _MOVES.search(data):
            yield "sdf", file


def draw(clones: Path, seed: int, count: int) -> list[tuple[str, Path]]:
    """Draw files: formats in turn, each time from a repository of which the fewest were drawn."""
    chance = random.Random(seed)
    stock: dict[str, dict[str, list[Path]]] = defaultdict(lambda: defaultdict(list))
    for repository in sorted(one for one in clones.iterdir() if one.is_dir()):
        for kind, file in files_of(repository):
            stock[kind][repository.name].append(file)
    drawn: list[tuple[str, Path]] = []
    used: Counter[str] = Counter()
    while len(drawn) < count and any(stock.values()):
        kind = TURNS[len(drawn) % len(TURNS)]
        shelves = stock[kind] or next(one for one in stock.values() if one)
        names = sorted(shelves)
        fewest = min(used[name] for name in names)
        name = chance.choice([one for one in names if used[one] == fewest])
        file = shelves[name].pop(chance.randrange(len(shelves[name])))
        drawn.append((kind if shelves is stock[kind] else "", file))
        used[name] += 1
        if not shelves[name]:
            del shelves[name]
    return drawn


def finish(command: Sequence[str], limit: float, folder: Path) -> tuple[int, str, float]:
    """Run a command; return its exit code (-9 at the limit), output, and processor seconds."""
    with subprocess.Popen(
        command, cwd=folder, start_new_session=True, text=True, errors="replace",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as process:  # fmt: skip
        ends = time.monotonic() + limit
        seconds: dict[str, float] = {}
        while time.monotonic() < ends:
            seconds |= _seconds_by_process(process.pid)
            try:
                text, _ = process.communicate(timeout=0.2)
            except subprocess.TimeoutExpired:
                continue
            return process.returncode, text, sum(seconds.values())
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return -9, f"no end within {limit:g} s", sum(seconds.values())


def _seconds_by_process(session: int) -> dict[str, float]:
    """Return processor seconds of each process of a session: nothing waits for some workers."""
    seconds = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            fields = place.joinpath("stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session:
            seconds[place.name] = sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
    return seconds


def loading_engines(kind: str, file: Path) -> tuple[str, ...]:
    """Return the engines that load a file by themselves, each tried in a process of its own."""
    engines = []
    for engine, (formats, code) in LOADERS.items():
        if kind in formats.split():
            first = "import sys; f = sys.argv[1]; " + (_EXPAND if kind == "xacro" else "")
            if finish([sys.executable, "-c", first + code, str(file)], 180, file.parent)[0] == 0:
                engines.append(engine)
    return tuple(engines)


def mass_difference(file: Path) -> float | None:
    """Return the difference of the mass matrices, computed in another process; None without one."""
    command = [sys.executable, "-m", "campaigns.real_models.masses", str(file)]
    code, text, _ = finish(command, 180, file.parent)
    numbers = re.findall(r"(?m)^(\d\.\de[-+]\d+) ", text)
    return float(numbers[0]) if numbers and code == 0 else None


def run(kind: str, file: Path, clones: Path, limit: float) -> DrawnFile:
    """Run `crosscheck run` on a file, and load it in the engines alone."""
    with tempfile.TemporaryDirectory() as out:
        program = [sys.executable, "-m", "physics_crosscheck", "run", "--jobs", "1", "--out", out]
        code, text, seconds = finish([*program, str(file)], limit, file.parent)
        try:
            results = read_results(Path(out, "results.json"))
            cases, models = results.cases, results.models
        except (ResultsError, OSError):
            cases, models = (), ()
    reasons = [
        f"{case.outcome} {case.engine} {case.code or '-'}: {case.reason}"
        for case in cases
        if case.outcome is not Outcome.AGREES
    ]
    reasons += [
        f"cause {model.engine} {cause.code}: {cause}"
        for model in models
        if model.diagnosis
        for explanation in model.diagnosis.explanations[:1]
        for cause in explanation.causes
    ]
    return DrawnFile(
        file=str(file.relative_to(clones)),
        format=kind,
        code=code,
        seconds=seconds,
        outcomes={case.engine: case.outcome for case in cases},
        reasons=tuple(reasons if cases else [f"no result: {text.strip()[-300:]}"]),
        loading=loading_engines(kind, file),
        mass=mass_difference(file) if cases else None,
        is_static=any(case.kind == "no joint" for case in cases),
    )


def generic(reason: str) -> str:
    """Return a reason without paths, names and numbers, so that equal ones count together."""
    reason = re.sub(r"/?[\w.+@-]*/[\w./+@-]+(:\d+)*", "FILE", reason)
    reason = re.sub(r"'[^']*'|\"[^\"]*\"|(?<![\w-])-?\d+(\.\d+)?(e[-+]?\d+)?\b", "*", reason)
    return re.sub(r"\*(,? (and )?\*)+", "*", re.sub(r"\s+", " ", reason))[:180]


def table(title: str, rows: dict[str, list[str]]) -> str:
    """Return a table with a line per kind, most frequent first, with names of files."""
    lines = [title]
    for what, names in sorted(rows.items(), key=lambda row: -len(row[1])):
        more = ", ..." if len(names) > EXAMPLES else ""
        lines.append(f"  {len(names):5}  {what}  [{', '.join(names[:EXAMPLES])}{more}]")
    return "\n".join(lines if rows else [title, "  none"])


def tables(results: Sequence[DrawnFile]) -> str:
    """Return exit codes by format, files without verdict, and reasons by kind."""
    lines = [
        f"{len(results)} files of {len({one.file.split('/')[0] for one in results})} repositories"
    ]
    for kind in dict.fromkeys(TURNS):
        of_kind = [one for one in results if one.format == kind]
        codes = Counter(one.code for one in of_kind)
        counts = ", ".join(f"{number} with {code}" for code, number in sorted(codes.items()))
        lines.append(f"{kind}: {len(of_kind)} files; exit codes: {counts or 'none'}")
    loads = [one for one in results if one.loading]
    missing = sum(not one.has_verdict for one in loads)
    still = sum(one.is_static for one in loads)
    lines.append(
        f"{missing} of {len(loads)} files that an engine loads have no verdict, {still} are static"
    )
    masses = [one.mass for one in results if one.mass is not None]
    lines.append(f"{sum(one < SAME for one in masses)} of {len(masses)} mass matrices agree")
    seconds = [one.seconds for one in results] or [0.0]
    lines.append(
        f"processor time: median {statistics.median(seconds):.1f} s, most {max(seconds):.1f} s"
    )
    rows_by_title: dict[str, dict[str, list[str]]] = {
        title: defaultdict(list) for title in ("no verdict, by reason", "other reasons")
    }
    silent, other = rows_by_title.values()
    for result in results:
        for reason in result.reasons:
            rows = other if result.has_verdict else silent
            rows[f"{result.format} {result.code} {generic(reason)}"].append(result.file)
    lines += ["DIFFERS, each with the difference of the mass matrices:"]
    lines += [
        f"  {engine} {one.file}: {'none' if one.mass is None else one.mass}"
        for one in results
        for engine, outcome in one.outcomes.items()
        if outcome is Outcome.DIFFERS
    ]
    return "\n\n".join(
        ["\n".join(lines), *(table(title, rows) for title, rows in rows_by_title.items())]
    )


def main() -> None:
    """Run the drawn files that have no kept result, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clones", type=Path, help="folder of clones")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=150, help="files to draw [150]")
    parser.add_argument("--formats", nargs="*", default=list(dict.fromkeys(TURNS)))
    parser.add_argument("--limit", type=float, default=600.0, help="elapsed seconds per file [600]")
    parser.add_argument("--kept", type=Path, default=Path("drawn.jsonl"), help="file of results")
    parser.add_argument("--clone", action="store_true", help="clone missing repositories first")
    options = parser.parse_args()
    clones = options.clones.resolve()
    if options.clone:
        clone(clones)
    lines = options.kept.read_bytes().splitlines() if options.kept.exists() else []
    done = {one.file: one for one in (msgspec.json.decode(x, type=DrawnFile) for x in lines)}
    drawn = draw(clones, options.seed, options.count)
    for kind, file in drawn:
        if kind not in options.formats or str(file.relative_to(clones)) in done:
            continue
        result = run(kind, file, clones, options.limit)
        done[result.file] = result
        with options.kept.open("ab") as kept:
            kept.write(msgspec.json.encode(result) + b"\n")
        print(f"{result.code:3} {result.seconds:6.1f} s {result.file}", flush=True)
    names = [str(file.relative_to(clones)) for _, file in drawn]
    print("\n" + tables([done[name] for name in names if name in done]))


if __name__ == "__main__":
    main()

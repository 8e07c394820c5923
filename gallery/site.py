"""The site of the gallery: robots by engines, a page for each engine and each message."""

from __future__ import annotations

import base64
import csv
import io
import re
import shutil
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from filecmp import cmp
from pathlib import Path

import jinja2
import msgspec

from campaigns.report_pictures import write_pictures
from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.codes import codes
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html import environment, template
from physics_crosscheck.harness.render.terminal.models_table import engine_cells
from physics_crosscheck.harness.results.headline import engine_title, headline
from physics_crosscheck.harness.results.status import counted
from .robots import RobotFile

PAGES = Path(__file__).with_name("pages")
CONFIRMED = Path(__file__).with_name("confirmed.toml")
"""Means that confirm a cell, by file, and by engine with its version."""

FINDINGS = Path(__file__).with_name("findings")
"""Texts for maintainers of a robot or an engine."""

PICTURE, RESULTS, COMPARED = "picture.png", "results.json", "compare.html"
COMPARISON, VERSIONS = "compare.txt", "versions"
"""A command that compares the file with the robot's first one, and what it printed; the folder of
those that compare versions of an engine."""


FAULTS = (Outcome.DIFFERS, Outcome.REFUSED)
"""Outcomes that a line of the file explains; others are limits of a run, or name their line."""


BEHAVIOURS = ("XC148", "XC207")
"""Codes of sentences on what an engine does by itself."""

HEADER = '<header class="bar">'
"""Start of a report."""


class Done(Record, frozen=True, kw_only=True):
    """A finished run of a file.

    Attributes:
        address: of the file, with its commit.
        versions: of the program and the engines.
        command: that repeats the run, in a clone of the repository.
    """

    address: str
    versions: Mapping[str, str | None]
    command: str


class Cell(Record, frozen=True, kw_only=True):
    """A robot's file in an engine.

    Attributes:
        robot, kind, file: title and kind of the robot, and address of its file with the commit.
        engine, version: name and version of the engine.
        line: of the file, where the cause is; None for the whole file.
        outcome: see `Outcome`.
        text: digits to which the engine follows the file, or what goes wrong.
        sentence: fault, place and effect, or the digits.
        bound: largest uncertainty; None without a verdict.
        date: of the run, UTC.
        command: that repeats the run.
        confirmed: what shows it without this program; empty if nothing did.
        page: address of the report, relative to the site.
    """

    robot: str
    kind: str
    file: str
    engine: str
    version: str
    line: int | None = None
    outcome: Outcome
    text: str
    sentence: str
    bound: float | None
    date: str
    command: str
    page: str
    confirmed: str = ""


class Cells(Record, frozen=True, kw_only=True):
    """All cells, as in `gallery.json`."""

    cells: tuple[Cell, ...]


class Entry(Record, frozen=True, kw_only=True):
    """A robot's file with its run."""

    file: RobotFile
    done: Done
    results: Results

    @property
    def page(self) -> str:
        """Address of its report, relative to the site."""
        return f"robots/{self.file.slug}/index.html"

    @property
    def faults(self) -> dict[str, AuditFinding]:
        """Findings on the file itself by their messages: those that no engine's behaviour adds."""
        models = self.results.models
        return {
            one.message: one
            for model in models
            for one in model.findings
            if all(one in other.findings for other in models if other.audit is not None)
            and engine_title(model.engine) not in one.message
        }

    @property
    def cells(self) -> dict[str, Cell]:
        """The file in each engine that reads its format; faults of the file itself aside."""
        models = tuple(map(self._without_faults, self.results.models))
        results = msgspec.structs.replace(self.results, models=models)
        rows = engine_cells(results)
        return {
            engine: self._cell(results, engine, outcome, text)
            for row in rows.values()
            for engine, (outcome, text) in row.items()
            if outcome is not Outcome.ABSENT
        }

    def _without_faults(self, model: Model) -> Model:
        """Remove the faults of the file, unless a cause in the engine names them."""
        if model.diagnosis is not None and model.diagnosis.explained:
            return model
        audit = tuple(one for one in model.audit or () if one.message not in self.faults)
        return msgspec.structs.replace(model, audit=audit)

    def _cell(self, results: Results, engine: str, outcome: Outcome, text: str) -> Cell:
        mine = msgspec.structs.replace(
            results,
            cases=tuple(one for one in results.cases if one.engine == engine),
            models=tuple(one for one in results.models if one.engine == engine),
        )
        path = re.escape(self.file.path)
        sentence = re.sub(rf"^{path}(:\d+)?: ", "", _sentence(mine, outcome))
        verdicts = [one.verdict for one in mine.cases if one.verdict is not None]
        version = self.done.versions.get(engine) or ""
        has_line = outcome in FAULTS or "changes the file" in sentence
        means = {} if outcome is Outcome.AGREES else confirmed().get(self.file.slug, {})
        digits = [one.digits for one in mine.cases if one.digits is not None]
        if outcome is Outcome.AGREES and digits:  # an accepted rounding has digits too
            text = f"{min(digits):.1f}"
        return Cell(
            robot=self.file.robot,
            kind=self.file.kind,
            file=self.file.address,
            engine=engine,
            version=version,
            line=self._line(mine, sentence) if has_line else None,
            outcome=outcome,
            text=text,
            sentence=sentence,
            bound=max((one.uncertainty or 0.0 for one in verdicts), default=None),
            date=self.results.created,
            command=self.done.command,
            page=self.page,
            confirmed=means.get(f"{engine} {version}", ""),
        )

    def _line(self, results: Results, sentence: str) -> int | None:
        """Return the line of a cause in one engine, or of a name in a sentence, if any."""
        causes = [
            one.line
            for model in results.models
            if model.diagnosis is not None and model.diagnosis.explained
            for cause in model.diagnosis.explanations[0].causes
            for one in cause.locations
            if one.line is not None
        ]
        findings = [
            one.location
            for model in results.models
            for one in (*model.unexplained_findings, *model.findings)
        ]
        stated = re.findall(r"(?:line |\.\w+:)(\d+)", sentence)
        causes += map(int, stated)
        causes += (one.line for one in findings if one is not None and one.line is not None)
        causes += (one.line for case in results.cases for one in case.locations if one.line)
        return next(iter((*causes, *self._named(sentence))), None)

    def _named(self, sentence: str) -> Iterator[int]:
        """Yield the lines of names in a sentence, then of the file's faults, then of elements."""
        text = next((one.text for one in self.results.models if one.text), "")
        words = re.findall(
            r"'([^']+)'|([\w-]{3,})", sentence.replace(Path(self.file.path).name, "")
        )
        names = [re.escape(quoted or plain) for quoted, plain in words]
        for pattern in (r"name=[\"']{}[\"']", r"<{}?[\s>]"):
            for name in names:
                if place := re.search(pattern.format(name), text):
                    yield text.count("\n", 0, place.start()) + 1
            yield from (
                one.location.line
                for one in self.faults.values()
                if one.location is not None and one.location.line is not None
            )


def _sentence(results: Results, outcome: Outcome) -> str:
    """Return what one engine does with a file: fault, place and effect, or the digits."""
    if outcome is Outcome.AGREES:
        accepted = [
            f"The engine follows the file {c.accepted}." for c in results.cases if c.accepted
        ]
        return [*accepted, *headline(results)[-1:]][0]
    refused = [one.reason for one in results.cases if one.outcome is outcome and one.reason]
    if outcome is Outcome.DIFFERS or not refused:
        return " ".join(headline(results))
    return refused[0]


Messages = dict[tuple[str, str], list[tuple[str, Entry]]]
"""Engines and files by sentence and place."""

FilesByText = dict[str, dict[str, set[str]]]
"""Files by engine and text."""


def confirmed() -> dict[str, dict[str, str]]:
    """Return the means that confirm cells, by file, then by engine with its version."""
    return tomllib.loads(CONFIRMED.read_text("utf-8")) if CONFIRMED.exists() else {}


def wrong(entry: Entry, cells: Mapping[str, Cell]) -> dict[tuple[str, int | None], str]:
    """Return what goes wrong with a file: each sentence with its line, and whose fault it is."""
    names: dict[tuple[str, int | None], list[str]] = {}
    by_code: dict[str, list[AuditFinding]] = {}
    for fault in entry.faults.values():
        by_code.setdefault(fault.code, []).append(fault)
    for first, *others in by_code.values():
        line = None if first.location is None else first.location.line
        more = f" (and {len(others)} more like it)" if others else ""
        names[first.message + more, line] = ["the file"]
    for cell in cells.values():
        if cell.outcome is not Outcome.AGREES:
            title = "every engine" if cell.engine == "-" else engine_title(cell.engine)
            means = f" (confirmed: {cell.confirmed})" if cell.confirmed else ""
            names.setdefault((cell.sentence + means, cell.line), []).append(title)
    return {key: ", ".join(one) for key, one in names.items()}


def messages(entries: Iterable[Entry]) -> dict[str, Messages]:
    """Return by code: each sentence with its place, and the engines and files that have it."""
    found: dict[str, Messages] = {}
    for entry in entries:
        for code, engine, sentence, place in _messages(entry):
            by_sentence = found.setdefault(code, {})
            by_sentence.setdefault((sentence, f"{entry.file.slug}{place}"), []).append(
                (engine, entry)
            )
    return dict(sorted(found.items()))


def _messages(entry: Entry) -> Iterator[tuple[str, str, str, str]]:
    """Yield code, engine, sentence and line of findings, causes and cases that don't agree.

    Advice and faults of the file belong to the file, not to the engines that load it.
    """
    results, faults = entry.results, entry.faults
    for model in results.models:
        for finding in model.audit or ():
            if finding.code and finding.severity != "note":
                line = finding.location.line if finding.location else None
                of_file = finding.severity == "advice" or finding.message in faults
                owner = "the file" if of_file else model.engine
                yield finding.code, owner, finding.message, f":{line}" if line else ""
        diagnosis = model.diagnosis
        for behaviour in diagnosis.behaviours if diagnosis else ():
            line = behaviour.location.line if behaviour.location else None
            yield behaviour.code, model.engine, behaviour.message, f":{line}" if line else ""
        best = diagnosis.explanations[:1] if diagnosis and diagnosis.explained else ()
        for cause in (one for explanation in best for one in explanation.causes):
            line = cause.locations[0].line if cause.locations else None
            yield cause.code, model.engine, str(cause), f":{line}" if line else ""
    for case in results.cases:
        if case.code and not case.passes:
            yield case.code, case.engine, case.reason, ""


_DETAILS = (
    r"\s*\([^()]*\)| explains the motion.*|, (up to )?[\d.]+e-\d+ .*"
    r"| of (\S+, )+\S+( and \d+ more)?(?=,|$)"
)
"""Names and sizes in the sentence of a cause, which depend on the file."""


def _general(sentence: str) -> str:
    """Return a sentence of a cause without names and sizes."""
    short = re.sub(r"<mimic> of \S+", "<mimic>", re.sub(_DETAILS, "", sentence))
    return re.sub(r"of (\d+ links?|a link)\b", "of links", short)


def changes(cells: Sequence[Cell], before: Sequence[Cell]) -> list[str]:
    """Return a sentence for each cell whose outcome or digits changed, worst first."""
    past = {(one.page, one.engine): one for one in before}
    lines = []
    for cell in sorted(cells, key=lambda one: -one.outcome.severity):
        old = past.get((cell.page, cell.engine))
        if old is not None and (old.outcome, old.text) != (cell.outcome, cell.text):
            versions = f"{old.version} to {cell.version}" if old.version != cell.version else "same"
            lines.append(
                f"{cell.robot} in {engine_title(cell.engine)} ({versions} version): "
                f"{old.text} -> {cell.text}. {cell.sentence}"
            )
    return lines


def open_questions(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield cells that don't follow their file without sentence, line or means; stale means."""
    rows = {(slug, engine) for slug, row in confirmed().items() for engine in row}
    for cell in cells:
        slug = cell.page.split("/")[1]
        if cell.outcome is not Outcome.AGREES:
            line = cell.line or cell.outcome not in FAULTS
            parts = {"sentence": cell.sentence, "line": line, "means": cell.confirmed}
            if missing := [name for name, value in parts.items() if not value]:
                yield f"{slug} in {cell.engine} has no {' and no '.join(missing)}"
            rows.discard((slug, f"{cell.engine} {cell.version}"))
    slugs = {cell.page.split("/")[1] for cell in cells}
    for slug, engine in sorted(one for one in rows if one[0] in slugs):
        yield f"{CONFIRMED.name} confirms {slug} in {engine}, which has no such cell"


def write_site(site: Path, store: Path, entries: Sequence[Entry]) -> list[Cell]:
    """Write all pages, with the cells as JSON and CSV, and the changes since the last ones.

    Return the cells.

    Args:
        site: its folder.
        store: folder with a folder for each file.
        entries: the files that ran.
    """
    rows = [(entry, entry.cells) for entry in entries]
    cells = [cell for _, row in rows for cell in row.values()]
    names = list(dict.fromkeys(one.engine for one in cells if one.engine != "-"))
    inherited = environment().loader
    assert inherited is not None
    pages = environment().overlay(
        loader=jinja2.ChoiceLoader([jinja2.FileSystemLoader(PAGES), inherited]), cache_size=0
    )

    def write(path: str, page: str, title: str, **values: object) -> None:
        text = template(pages.get_template(page), title=title, titles=engine_title, **values)
        write_whole(site / path, text)

    for entry in entries:
        _copy_report(store / entry.file.slug, site / "robots" / entry.file.slug)
    folders = [site / "robots" / entry.file.slug for entry in entries]
    try:
        write_pictures({one: one / PICTURE for one in folders if not (one / PICTURE).exists()})
    except (OSError, AssertionError) as error:  # a busy machine; the next call draws the others
        print(f"pictures are missing: {error}", flush=True)
    found, known = messages(entries), codes()
    for code, sentences in found.items():
        write(f"messages/{code}.html", "message.html", f"{code}: {known[code].title}",
              sentences=sentences)  # fmt: skip
    by_engine, causes = _by_engine(found)
    for name in names:
        mine = [cell for cell in cells if cell.engine == name]
        write(f"engines/{name}.html", "engine.html", engine_title(name), cells=mine,
              codes=by_engine[name], messages=known, causes=causes[name])  # fmt: skip
    good = sum(one.outcome is Outcome.AGREES for one in cells)
    count = len({one.robot for one in cells})
    title = f"{count} public robots in {len(names)} engines: {good} of {len(cells)} follow the file"
    pictures = {entry.file.slug: _inlined(site / "robots" / entry.file.slug) for entry in entries}
    write("index.html", "matrix.html", title, rows=rows, names=names, pictures=pictures,
          codes={code: len(one) for code, one in found.items()}, messages=known,
          wrong=wrong, counted=counted)  # fmt: skip
    texts = {
        entry.file.slug: path.read_text("utf-8")
        for entry in entries
        if (path := store / entry.file.slug / COMPARISON).exists()
    }
    write("formats.html", "texts.html", "Formats of one robot, compared", texts=texts,
          kind="formats")  # fmt: skip
    for kind, title, paths in (
        ("versions", "Versions of one engine, compared", (store / VERSIONS).glob("*.txt")),
        ("findings", "Findings for maintainers, as texts of issues", FINDINGS.glob("*.md")),
    ):
        texts = {one.stem: one.read_text("utf-8") for one in sorted(paths)}
        write(f"{kind}.html", "texts.html", title, texts=texts, kind=kind)
    write("objections.html", "objections.html", "How to object, and how to add a robot",
          entries=entries)  # fmt: skip
    _write_cells(site, cells)
    return cells


def _copy_report(source: Path, target: Path) -> None:
    """Copy the report of a file, with links to the matrix and to its comparison."""
    if (target / RESULTS).exists() and not cmp(source / RESULTS, target / RESULTS):
        (target / PICTURE).unlink(missing_ok=True)  # of the robot before
    shutil.copytree(source, target, dirs_exist_ok=True)
    links = '<a href="../../index.html">All robots</a>'
    if (target / COMPARED).exists():
        links += f' <a href="{COMPARED}">Compared with its first format</a>'
    for page in (target / "index.html", target / COMPARED):
        if page.exists():
            page.write_text(page.read_text("utf-8").replace(HEADER, HEADER + links), "utf-8")


def _by_engine(found: Mapping[str, Messages]) -> tuple[FilesByText, FilesByText]:
    """Return the files by message of each engine, and by what it does by itself."""
    by_code: FilesByText = defaultdict(lambda: defaultdict(set))
    causes: FilesByText = defaultdict(lambda: defaultdict(set))
    for code, sentences in found.items():
        for (sentence, place), places in sentences.items():
            file = place.split(":")[0]
            for engine, _ in places:
                by_code[engine][code].add(file)
                if code in BEHAVIOURS:
                    causes[engine][_general(sentence)].add(file)
    return by_code, causes


def _inlined(folder: Path) -> str:
    """Return a picture as an address, since pages load no files; empty without one."""
    picture = folder / PICTURE
    if not picture.exists():
        return ""
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode()}"


def _write_cells(site: Path, cells: Sequence[Cell]) -> None:
    path = site / "gallery.json"
    before = msgspec.json.decode(path.read_bytes(), type=Cells).cells if path.exists() else ()
    write_whole(site / "changes.txt", "".join(f"{one}\n" for one in changes(cells, before)))
    write_whole(path, encoded(Cells(cells=tuple(cells))))
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(Cell.__struct_fields__)
    table.writerows(msgspec.structs.astuple(cell) for cell in cells)
    write_whole(site / "gallery.csv", text.getvalue())

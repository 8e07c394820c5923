"""Findings that a project ignores: by `--select`, `--ignore`, or a comment in a model file."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from .places import shown_line
from .status import counted

IGNORABLE = ("XC1", "XC2", "XC3")
"""Groups of codes that can be ignored: a file that is not read or a failed run always counts."""

_COMMENT = re.compile(rb"crosscheck:\s*ignore\s+(XC\d+(?:[\s,]+XC\d+)*)")


@dataclass(frozen=True, kw_only=True)
class CodeFilter:
    """Prefixes of codes to report, by default all, and to ignore among these.

    It notes the code, line and subject of each finding and case that was `ignored`.
    """

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    ignored: set[tuple[str, ...]] = field(default_factory=set, init=False)
    _rows: dict[str, list[bytes]] = field(default_factory=dict, init=False)

    def reported(self, findings: Sequence[AuditFinding], folder: str = "") -> list[AuditFinding]:
        """Return the findings that are not ignored, and count the others; notes always stay.

        Paths of lines are relative to the folder of the model, or complete without one.
        """
        kept = []
        for finding in findings:
            where = () if finding.location is None else (finding.location,)
            if finding.severity == "note" or not self._ignores(finding.code, where, folder):
                kept.append(finding)
            else:
                self.ignored.add((finding.code, *map(str, where), *finding.subject))
        return kept

    def results(self, results: Results) -> Results:
        """Return results in which ignored cases count as accepted, without ignored findings."""
        models = tuple(map(self.model, results.models))
        cases = tuple(
            self.case(case, model.diagnosis if (model := results.model_of(case)) else None)
            for case in results.cases
        )
        return replace(results, models=models, cases=cases)

    def model(self, model: Model) -> Model:
        """Return a model without the ignored findings of its audit."""
        if model.audit is None:
            return model
        return replace(model, audit=tuple(self.reported(model.audit, model.folder)))

    def lines(self) -> list[str]:
        """Return one line about what was ignored; none if nothing was."""
        codes = ", ".join(sorted({code for code, *_ in self.ignored}))
        return [f"{counted(len(self.ignored), 'finding')} ignored: {codes}"] if codes else []

    def case(self, case: Case, diagnosis: Diagnosis | None) -> Case:
        """Return a case, marked as accepted if it or each of its diagnosed causes is ignored."""
        if case.outcome is Outcome.AGREES or case.accepted:
            return case
        rows = [(case.code, case.locations)]
        if diagnosis and diagnosis.explained and diagnosis.explanations:
            rows = [(one.code, one.locations) for one in diagnosis.explanations[0].causes]
        is_whole = self._ignores(case.code, (), case.folder)
        if not is_whole and not all(self._ignores(*row, case.folder) for row in rows):
            return case
        codes = [case.code] if is_whole else [code for code, _ in rows]
        self.ignored.add((codes[0], *case.key))
        return replace(case, accepted=f"ignored: {', '.join(dict.fromkeys(codes))}")

    def _ignores(self, code: str, lines: Sequence[SourceLine], folder: str) -> bool:
        if not code.startswith(IGNORABLE):
            return False
        if not code.startswith(self.select or ("",)) or code.startswith(self.ignore or ("-",)):
            return True
        return bool(lines) and all(code in self._ignored_at(one, folder) for one in lines)

    def _ignored_at(self, where: SourceLine, folder: str) -> list[str]:
        """Return the codes that comments on a line, or on the line above, ignore."""
        place = shown_line(folder, where) if folder else where
        if place.line is None:
            return []
        if place.file not in self._rows:
            try:
                text = read_regular(Path(place.file))
            except OSError:
                text = b""
            self._rows[place.file] = text.splitlines()
        rows = self._rows[place.file][max(place.line - 2, 0) : place.line]
        comments = _COMMENT.findall(b"\n".join(rows))
        return re.findall(r"XC\d+", b" ".join(comments).decode())

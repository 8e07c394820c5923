"""The first sentences of a result: robot, engine, fault and effect, before any count."""

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case, Verdict
from physics_crosscheck.harness.records.cause import SWITCHES
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.results import Results
from .causes import brief_cause
from .issues import Issue, collect_issues, explained_alike
from .messages import find_code
from .next_steps import massless_links
from .status import counted, listed, percent

WITH_ALL = "with limits, friction, contacts and drives"
"""Forces of whole steps."""

POSES_NAMED = 3
"""Number of bodies to name in a headline."""

NAMED = 3
"""Number of files to name in a sentence."""

MISSPELLED = "XC156"
"""Code of a name that the format lacks."""


def headline(results: Results) -> list[str]:
    """Return sentences on what is wrong in each engine's motion, or that engines follow the files.

    They name robot, engine, fault and effect of one file, and files by engine of several.
    """
    files = {(c.folder, c.model) for c in results.cases if c.outcome is not Outcome.ABSENT}
    issues = [
        one for one in collect_issues(results.cases) if one.worst.outcome is not Outcome.ABSENT
    ]
    if not files:
        return []
    faults = _faults(results, issues, several=len(files) > 1)
    doubts = [] if issues or faults else _doubtful_number(results)
    if len(files) == 1:
        refused = [one for one in issues if one.worst.outcome is Outcome.REFUSED]
        sentences = [_issue_sentence(one, results) for one in issues if one not in refused]
        is_first = any(one.code == MISSPELLED for m in results.models for one in m.findings[:1])
        sentences = faults + sentences if is_first else sentences + faults
        sentences += [*_of_files(results, refused, 0), *_followers(results, [*sentences, *refused])]
    else:
        sentences = [*_of_files(results, issues, 0 if faults else len(files)), *faults]
    sentences = [*doubts, *sentences]
    return [one if one.endswith("?") else f"{one}." for one in sentences]


def _doubtful_number(results: Results) -> list[str]:
    """Return the first implausible number of the only file that has some, with its line."""
    files = {(one.folder, one.model): one.advice for one in results.models if one.advice}
    if len(files) != 1:
        return []
    ((_, name), (first, *others)) = next(iter(files.items()))
    code = find_code(first.code)
    title = "An implausible number" if code is None else code.title.removesuffix(".")
    name = _line_name(first.location, name)
    title += f" ({listed(first.subject, NAMED)})" if first.subject else ""
    more = f"; {counted(len(others), 'more implausible number')}" if others else ""
    return [f"{name}: {title[0].lower()}{title[1:]}{more}"]


def _line_name(place: SourceLine | None, name: str) -> str:
    """Return a file and its line; the given name without a line."""
    return name if place is None or not place.line else f"{PurePath(place.file).name}:{place.line}"


def _file(case: Case | Model) -> str:
    """Return the name of a robot file, or of a model of a system."""
    return case.model if case.folder.endswith(case.model) else f"{case.system}/{case.model}"


def _issue_sentence(issue: Issue, results: Results) -> str:
    case, cases = issue.worst, (issue.worst, *issue.others)
    if case.engine == "-":
        return case.reason.rstrip(".")
    keys = {one.key for one in cases}
    groups = explained_alike(one for one in results.models if one.key in keys)
    if case.outcome is not Outcome.DIFFERS or not (groups or difference(case)):
        return _of_files(results, [issue], 1)[0]
    if not groups:
        return f"{_file(case)} in {_titles(case.engine for case in cases)}: {difference(case)}"
    worst = next((one for one in groups if case.key in {m.key for m in one}), groups[0])
    return _explained(worst, [one for one in cases if one.key in {m.key for m in worst}] or cases)


def _explained(models: Sequence[Model], cases: Sequence[Case]) -> str:
    """Return fault and effect of a file in engines in which it differs for the same cause."""
    model, case = models[0], cases[0]
    engine_titles, effect = _titles(case.engine for case in cases), difference(case)
    diagnosis = model.diagnosis
    if diagnosis is None or not diagnosis.explained:
        fault = next((one.message for one in model.unexplained_findings), "")
        return f"{_file(case)} in {engine_titles}: {fault and f'{fault}; '}{effect}"
    cause = diagnosis.explanations[0].causes[0]
    if massless := massless_links(cause, model):
        verb = "drops" if len({one.engine for one in cases}) == 1 else "drop"
        links = counted(len(massless), "link")
        return f"{engine_titles} {verb} the inertia of {links} of {_file(case)}: {effect}"
    if cause.kind in SWITCHES:
        begin = "" if str(cause).startswith(f"{engine_titles}'s") else f" in {engine_titles}"
        return f"{_file(case)}{begin}: {cause}; {effect}"
    return f"{_file(case)} in {engine_titles}: {brief_cause(cause)}; {effect}"


def _faults(results: Results, issues: Sequence[Issue], *, several: bool = False) -> list[str]:
    """Return what the audit finds in files whose motions show none: one fault, or several files."""
    differing = {one.worst.folder for one in issues if one.worst.outcome is Outcome.DIFFERS}
    models = [one for one in results.models if one.findings and not one.accepted]
    faulty = [one for one in models if one.folder not in differing or _misspelled(one)]
    if several and faulty:
        return [f"The audit finds faults in {listed([*dict.fromkeys(map(_file, faulty))], NAMED)}"]
    return [
        f"{_line_name(one.findings[0].location, _file(one))}: {one.findings[0].message}"
        for one in faulty[:1]
    ]


def _misspelled(model: Model) -> bool:
    """Return whether the first finding is a name that the format lacks: a cause of differences."""
    return model.findings[0].code == MISSPELLED


def _followers(results: Results, problems: Sequence[object]) -> list[str]:
    """Return which engines follow the file, and to how many digits."""
    alike = [case for case in results.cases if case.outcome is Outcome.AGREES]
    engines_amiss = {case.engine for case in results.cases if not case.passes}
    alike = [case for case in alike if case.engine not in engines_amiss]
    if problems:  # to less than a digit follows nothing
        alike = [case for case in alike if case.digits is None or case.digits >= 1]
    if not alike:
        return []
    verb = "follows" if len({case.engine for case in alike}) == 1 else "follow"
    what = "the file" if problems else _file(alike[0])
    what = f"the poses of {what}" if all(map(by_poses, alike)) else what
    return [f"{_titles(case.engine for case in alike)} {verb} {what}{_to(alike)}"]


def by_poses(case: Case) -> bool:
    """Return whether a case agrees by its poses, since its file has no inertias."""
    verdict = case.verdict
    return case.outcome is Outcome.AGREES and verdict is not None and verdict.decided_by == "poses"


_VERBS = {
    Outcome.REFUSED: ("can't load", "can't load"),
    Outcome.DIFFERS: ("does not follow", "do not follow"),
}
"""Verbs after one engine, and after several."""

_NO_VERDICT = ("has no verdict on", "have no verdict on")


def _of_files(results: Results, issues: Sequence[Issue], count: int) -> list[str]:
    """Return which engines do not follow which of several files."""
    amiss: dict[tuple[str, tuple[str, str]], dict[str, None]] = {}
    for issue in issues:
        for case in (issue.worst, *issue.others):
            loads = case.outcome is Outcome.REFUSED and "can't load it" not in case.reason
            verbs = _NO_VERDICT if loads else _VERBS.get(case.outcome, _NO_VERDICT)
            amiss.setdefault((case.engine, verbs), {})[_file(case)] = None
    alike: dict[tuple[tuple[str, str], str], list[str]] = {}
    for (engine, verbs), files in amiss.items():
        alike.setdefault((verbs, listed([*files], NAMED)), []).append(engine)
    if count and not alike:
        return [f"Every engine follows all {count} files{_to(results.cases)}"]
    sentences = []
    for (verbs, which), names in alike.items():
        by_engine = f"{_titles(names)} {verbs[len(names) > 1]} {which}"
        sentences.append(f"{which} can't be checked" if names == ["-"] else by_engine)
    return sentences


def _to(cases: Iterable[Case]) -> str:
    digits = [case.digits for case in cases if case.digits is not None]
    return f" to {min(digits):.1f} digits" if digits else ""


def _titles(names: Iterable[str]) -> str:
    """Return the names of engines in a sentence."""
    *others, last = map(engine_title, dict.fromkeys(names))
    return f"{', '.join(others)} and {last}" if others else last


def engine_title(engine: str) -> str:
    """Return an engine's own name with its capitals; of an unknown one the name as it is."""
    adapter = engines().get(engine)
    return engine if adapter is None else adapter.title


def is_single_file(results: Results) -> bool:
    """Return whether a run checks a single robot of a file, so that only engines need names."""
    robots = {(case.folder, case.model, case.system) for case in results.cases}
    return len(robots) == 1 and all(folder.endswith(model) for folder, model, _ in robots)


def difference(case: Case) -> str:
    """Return the size of a case's difference, in words."""
    verdict, dynamics = case.verdict, case.forward_dynamics
    if verdict is None or verdict.discrepancy is None:
        return case.reason
    if case.kind == "pose" and case.poses is not None:
        return _poses_differ(case.poses)
    if case.kind in ("compiled number", "contact"):
        return case.reason
    if case.kind == "whole step":
        return f"{verdict.component} off by up to {percent(verdict.discrepancy)} {WITH_ALL}"
    if _is_motion(verdict):
        return _motion_differs(verdict)
    if verdict.discrepancy == verdict.map_residual and case.folder.endswith(case.model):
        joint = verdict.component.removesuffix("_dot")
        return f"{joint} leaves its coupling by up to {percent(verdict.discrepancy)}"
    if dynamics is not None and dynamics.outcome is Outcome.DIFFERS and dynamics.discrepancy:
        component = dynamics.component.removesuffix("_ddot")
        return f"acceleration of {component} off by up to {percent(dynamics.discrepancy)}"
    return case.reason


def _poses_differ(poses: Poses) -> str:
    """Return which bodies are elsewhere, and how far."""
    names = ", ".join(one.name for one in poses.wrong[:POSES_NAMED])
    more = len(poses.wrong) - POSES_NAMED
    far = max(one.position or 0.0 for one in poses.wrong)
    turned = max(one.rotation or 0.0 for one in poses.wrong)
    by = f"{turned:.3g} degrees" if far <= (poses.uncertainty or 0.0) else f"{far:.3g} m"
    return f"{names}{f' and {more} more' if more > 0 else ''} off by up to {by}"


def _is_motion(verdict: Verdict) -> bool:
    """Return whether a motion decides, and not the coordinate map of the engine."""
    e, u = verdict.discrepancy, verdict.uncertainty
    return e is not None and e > (u or 0.0) and e != verdict.map_residual


def _motion_differs(verdict: Verdict) -> str:
    """Return how far a component is off, and by its sign that it is too fast or too slow."""
    joint = verdict.component.removesuffix("_dot").removesuffix("_ddot")
    if verdict.excess is not None:
        direction = "too fast" if verdict.excess > 0 else "too slowly"
        return f"{joint} accelerates up to {percent(abs(verdict.excess))} {direction}"
    is_velocity = verdict.component.endswith("_dot")
    name = f"velocity of {joint}" if is_velocity else verdict.component
    return f"{name} off by up to {percent(verdict.discrepancy or 0.0)}"

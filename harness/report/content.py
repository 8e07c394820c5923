"""The numbers and plots of every case, system and diagnosis, packed for the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import Any

from harness.report.case_charts import OVERLAID, case_charts
from harness.report.model_charts import hypotheses, reaches, redrawn, responses
from harness.report.packs import Chart, Pack
from harness.report.runs import Run, largest, runs

Record = Mapping[str, Any]
Key = tuple[str, str, str]


class Content:
    """Packs of a report, under the ids of the elements that hold them.

    Charts of one pack may show numbers of another, so they are all made before any is packed.
    """

    def __init__(self, found: Record) -> None:
        self._systems = {system["folder"]: system for system in found["systems"]}
        self._runs = runs(found["cases"])
        self._packs: dict[str, tuple[Pack, tuple[Chart, ...], dict[str, Any]]] = {}
        self._linear: dict[Key, tuple[Chart, ...]] = {}
        for place, model in enumerate(found["models"]):
            system = self._systems.get(model["folder"])
            if system is not None:
                pack = Pack(f"pack-model-{place}")
                charts = responses(pack, model, system)
                self._linear[_key(model)] = charts
                self._keep(pack, ())
        for place, system in enumerate(found["systems"]):
            pack = Pack(f"pack-system-{place}")
            self._keep(pack, reaches(pack, system), sketch=system.get("sketch"))
        self._system_packs = {
            system["folder"]: f"pack-system-{place}"
            for place, system in enumerate(found["systems"])
        }
        self._keep_cases(_reach(found["cases"]))
        self._diagnosis_packs = {
            place: self._diagnosed(place, model) for place, model in enumerate(found["models"])
        }

    def case_pack(self, place: int) -> str:
        """Id of the pack of the case at that place; empty without series."""
        run = self._runs[place]
        return "" if run is None else run.pack.id

    def system_pack(self, folder: str) -> str:
        """Id of the pack of a folder's system."""
        return self._system_packs[folder]

    def diagnosis_pack(self, place: int) -> str:
        """Id of the pack of the diagnosis of the model at that place; empty without."""
        return self._diagnosis_packs[place]

    def packs(self) -> dict[str, str]:
        """Every pack, by its id."""
        return {
            name: pack.packed(charts, **more) for name, (pack, charts, more) in self._packs.items()
        }

    def _keep(self, pack: Pack, charts: Iterable[Chart], **more: Any) -> None:
        self._packs[pack.id] = pack, tuple(charts), more

    def _keep_cases(self, reach: Mapping[str, list[float]]) -> None:
        together: dict[tuple[str, str], list[Run]] = {}
        for run in self._runs:
            if run is not None:
                together.setdefault((run.case["folder"], run.case["scenario"]), []).append(run)
        for run in self._runs:
            if run is None:
                continue
            folder = run.case["folder"]
            others = [r for r in together[folder, run.case["scenario"]] if r is not run]
            charts = case_charts(run, others, self._units(run), reach[folder])
            system = self._system_packs.get(folder)
            linear = self._linear.get(_key(run.case), ())
            reaching = self._packs[system][1] if system else ()
            self._keep(
                run.pack, (*charts, *linear, *reaching), motion=self._motion(run, others, system)
            )

    def _motion(self, run: Run, others: Sequence[Run], system: str | None) -> dict[str, Any] | None:
        """Where the page finds what it animates; None without a sketch."""
        if system is None or self._packs[system][2]["sketch"] is None:
            return None
        half = len(run.reference) // 2
        return {
            "system": system,
            "t": run.t.key,
            "reference": [column.key for column in run.reference[:half]],
            "engine": [column.key for column in run.engine[:half]],
            "others": [
                {"t": astuple(other.t), "engine": [astuple(c) for c in other.engine[:half]]}
                for other in others[:OVERLAID]
            ],
        }

    def _units(self, run: Run) -> list[str]:
        """Units of the components: the coordinates', then those of their rates."""
        system = self._systems.get(run.case["folder"])
        if system is None:
            return ["?"] * len(run.reference)
        units = [coordinate["unit"] for coordinate in system["coordinates"]]
        return units + [f"{unit}/s" for unit in units]

    def _diagnosed(self, place: int, model: Record) -> str:
        diagnosis = model.get("diagnosis")
        if not diagnosis:
            return ""
        pack = Pack(f"pack-diagnosis-{place}")
        own = {
            run.case["scenario"]: run
            for run in self._runs
            if run is not None and _key(run.case) == _key(model)
        }
        charts = list(hypotheses(pack, diagnosis))
        if own:
            units = self._units(next(iter(own.values())))
            charts += redrawn(pack, diagnosis, own, units)
        if not charts:
            return ""
        self._keep(pack, charts)
        return pack.id


def _key(record: Record) -> Key:
    return record["folder"], record["model"], record["engine"]


def _reach(cases: Iterable[Record]) -> dict[str, list[float]]:
    """Largest magnitude of each component over all cases of a folder."""
    found: dict[str, list[float]] = {}
    for case in cases:
        if case["series"] is not None:
            sizes = [largest(row) for row in case["series"]["reference"]]
            before = found.get(case["folder"], [0.0] * len(sizes))
            found[case["folder"]] = [max(a, b) for a, b in zip(before, sizes, strict=True)]
    return found

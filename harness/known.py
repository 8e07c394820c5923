"""Known differences: cases that don't agree, were accepted so with a reason, and have not changed.

A known difference passes wherever cases are counted, and is shown as that. It must be the same one:
the outcome, and the model's and the equations' motion on the accepted track.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from harness.baseline import case_key, read_baseline
from harness.changes import is_known
from harness.track import Track, track_from


def known_tracks(baseline: Path | None) -> dict[str, Track]:
    """Tracks of all known differences of a baseline, by case id.

    Raises:
        BaselineError: for a baseline that can't be believed.
    """
    if baseline is None:
        return {}
    return {
        f"{name}/{key}": track_from(one.tracks[entry["track"]])
        for name, one in read_baseline(baseline).items()
        for key, entry in one.known.items()
    }


def mark_known(cases: Sequence[dict[str, Any]], baseline: Path | None) -> None:
    """Give every case that is a known difference the reason it was accepted with, `accepted`.

    One that was accepted and has changed since is told so in its own reason.
    """
    if baseline is None:
        return
    systems = read_baseline(baseline)
    for case in cases:
        measured = case.pop("measured", None)
        one = systems.get(case["system"])
        entry = one and one.known.get(case_key(case["model"], case["scenario"], case["engine"]))
        if not one or not entry or measured is None or case["outcome"] == "AGREES":
            continue
        if case["outcome"] in ("FAILED", "ABSENT"):
            continue
        changed = is_known(entry, one.tracks[entry["track"]], case | {"measured": measured})
        if changed:
            case["reason"] += (
                f"; a known difference was accepted here ({entry['reason']}), but {changed}"
            )
        else:
            case["accepted"] = entry["reason"]

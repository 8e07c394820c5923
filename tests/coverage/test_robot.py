"""Numbers of a robot's file that its motions depend on, counted by the equations alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.cases.robot import prepare_robot
from harness.coverage.robot import NO_SAY, count_robot
from harness.engines.registry import readers
from tests.robots.files import joint, link

PLACE = '<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
TEXT = "\n".join(
    [
        '<robot name="written">',
        link("base"),
        joint("a", "base", "one", PLACE + LIMIT, "revolute"),
        link("one"),
        "</robot>",
    ]
)


@pytest.mark.parametrize("engine", [one.name for one in readers(".urdf")])
def test_what_moves_no_end_is_told_by_name(tmp_path: Path, engine: str) -> None:
    file = tmp_path / "r.urdf"
    file.write_text(TEXT)
    found = count_robot(prepare_robot(file).task(engine, 1e-9))
    assert found.numbers == 3 + 1 + 6 + 3 + 3 + 4 + 3 + 1 + 6
    assert found.seen + sum(one.count for one in found.unseen) == found.numbers
    by_reason = {one.reason: one for one in found.unseen}
    assert by_reason["limits"].count == 4
    idle = by_reason[NO_SAY].examples
    assert len(idle) == by_reason[NO_SAY].count
    # The mass of what stands still, where the joint is, and moments about other axes have no say.
    assert {"link[base]/inertial/mass@value", "joint[a]/origin@xyz[2]",
            "link[one]/inertial/inertia@ixx"} <= set(idle)  # fmt: skip
    assert not {"link[one]/inertial/mass@value", "link[one]/inertial/inertia@iyy",
                "link[one]/inertial/origin@xyz[2]", "joint[a]/axis@xyz[2]"} & set(idle)  # fmt: skip

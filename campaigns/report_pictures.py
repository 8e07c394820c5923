"""Take the documentation's pictures of the report: RESULTS_FOLDER OUT NAME...

cp -r models/drum_pendulum found/models/    # then mass 0.9 in line 129 of robot.urdf
(cd found && crosscheck run models)
python -m campaigns.report_pictures found/reports docs overview.png case.png diagnosis.png

crosscheck new arm --from kuka.urdf         # model.urdf of pybullet_data's kuka_iiwa
crosscheck run arm                          # with mass 2.97 in line 183 of arm/kuka.urdf
python -m campaigns.report_pictures reports docs robot.png
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

VIEWS = {
    "overview.png": ("", 1280, 800),
    "case.png": ("case-drum_pendulum/mujoco.xml/mujoco/free", 1280, 940),
    "robot.png": ("", 1280, 800),
    "diagnosis.png": ("diagnosis-drum_pendulum/robot.urdf/mujoco", 1280, 1300),
}


def main(report: Path, out: Path, names: Sequence[str]) -> None:
    """Write the named pictures with a headless Chromium."""
    for name in names:
        view, width, height = VIEWS[name]
        path = out.resolve() / name
        subprocess.run(
            [
                "chromium",
                "--headless",
                "--no-sandbox",
                "--hide-scrollbars",
                "--force-prefers-reduced-motion",
                "--enable-unsafe-swiftshader",
                "--virtual-time-budget=8000",
                f"--window-size={width},{height}",
                f"--screenshot={path}",
                f"{(report / 'index.html').resolve().as_uri()}#{view}",
            ],
            check=True,
            capture_output=True,
        )
        with Image.open(path) as picture:
            colours = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        colours.save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])

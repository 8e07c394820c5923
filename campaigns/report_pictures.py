"""Pictures of the report for the documentation: RESULTS_FOLDER OUT NAME...

cp -r models/drum_pendulum copy/models/     # then set mass 0.9 in line 129 of robot.urdf
(cd copy && crosscheck run models)
python -m campaigns.report_pictures copy/reports docs overview.png case.png diagnosis.png

cd franka_panda                             # of pybullet_data, with its meshes
crosscheck run panda.urdf --engine mujoco --engine pybullet
python -m campaigns.report_pictures reports docs robot.png   # animated
"""

from __future__ import annotations

import base64
import io
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from tests.report.chromium import CHROMIUM, Browser, Tab, running

VIEWS = {
    "overview.png": ("", 1280, 800),
    "case.png": ("case-drum_pendulum/mujoco.xml/mujoco/free", 1280, 940),
    "diagnosis.png": ("diagnosis-drum_pendulum/robot.urdf/mujoco", 1280, 1300),
}

ANIMATED = "robot.png"
"""An animated PNG of the first screen: both robots move from the worst state and back."""

SIZE, FRAMES, FRAME_MILLISECONDS = (1280, 690), 14, 90

VIEWER = "document.querySelector('.view.current .scene').viewer"

HAS_SCENE = "!!document.querySelector('.view.current .scene')"

CANVAS = """(() => {
  const canvas = document.querySelector(".view.current .scene canvas");
  canvas.scrollIntoView();
  const { x, y, width, height } = canvas.getBoundingClientRect();
  return { x: x + scrollX, y: y + scrollY, width, height, scale: 1 };
})()"""
"""Script that returns the rectangle of a scene."""

THUMBNAIL = (192, 144)

HEADLESS = (
    "chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=8000",
    "--force-prefers-reduced-motion", "--enable-unsafe-swiftshader",
)  # fmt: skip


@contextmanager
def headless_browser() -> Iterator[Browser]:
    """Yield a browser with a new profile, which it may still write while it ends."""
    profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
    with profile as folder, running(Path(folder)) as browser:
        yield browser


def frames(report: Path) -> Iterator[Image.Image]:
    """Yield pictures of the first screen, from the worst state to its end."""
    with headless_browser() as browser, browser.tab() as tab:
        tab.window(*SIZE)
        still = {"name": "prefers-reduced-motion", "value": "reduce"}
        tab.send("Emulation.setEmulatedMedia", features=[still])
        tab.send("Emulation.setScrollbarsHidden", hidden=True)
        tab.open((report / "index.html").resolve().as_uri())
        tab.until("document.querySelector('.view.current .scene [data-frames]')")
        tab.run(f"{VIEWER}.open({VIEWER}.states.worst)")
        for i in range(FRAMES):
            share = (1 - math.cos(math.pi * i / (FRAMES - 1))) / 2
            tab.run(f"{VIEWER}.set({{ time: {share} * {VIEWER}.horizon }})")
            tab.run("new Promise((done) => setTimeout(done, 300))")
            yield _picture(tab)


def _picture(tab: Tab, **options: Any) -> Image.Image:
    shot = tab.send("Page.captureScreenshot", format="png", **options)["data"]
    return Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")


def write_pictures(reports: Mapping[Path, Path]) -> None:
    """Write a small picture of the robot of each report, as drawn, if a browser is installed."""
    if not reports or CHROMIUM is None:
        return
    with headless_browser() as browser:
        for report, path in reports.items():
            with browser.tab() as tab:
                tab.window(640, 900)
                tab.send("Emulation.setScrollbarsHidden", hidden=True)
                tab.open((report / "index.html").resolve().as_uri())
                if not tab.run(HAS_SCENE):
                    continue
                tab.until("document.querySelector('.view.current .scene [data-frames]')")
                picture = _picture(tab, clip=tab.run(CANVAS))
                picture.thumbnail(THUMBNAIL)
                picture.quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)


def write_animation(report: Path, path: Path) -> None:
    """Write the animated picture, with one palette for all frames."""
    shots = list(frames(report))
    palette = shots[-1].quantize(200, dither=Image.Dither.NONE)
    forward = [shot.quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]
    first, *others = [*forward, *forward[-2:0:-1]]
    first.save(
        path, save_all=True, append_images=others, duration=FRAME_MILLISECONDS, loop=0,
        optimize=True,
    )  # fmt: skip


def main(report: Path, out: Path, names: Sequence[str]) -> None:
    """Write the named pictures with a headless Chromium."""
    for name in names:
        if name == ANIMATED:
            write_animation(report, out.resolve() / name)
            continue
        view, width, height = VIEWS[name]
        path = out.resolve() / name
        page = f"{(report / 'index.html').resolve().as_uri()}#{view}"
        options = [f"--window-size={width},{height}", f"--screenshot={path}", page]
        subprocess.run([*HEADLESS, *options], check=True, capture_output=True)
        with Image.open(path) as picture:
            colours = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        colours.save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])

"""Cost of a page's picture in a headless browser: first drawing, and each frame.

`python -m benchmarks.bench_page PAGE [FRAGMENT]` opens a page that `crosscheck run` wrote. Headless
browsers draw by software. `script` and `raster` are processor times, of the page and of drawing.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from campaigns.report_pictures import headless_browser
from tests.report.chromium import Browser, Tab

OPENINGS, FRAMES, SECONDS = 5, 30, 3.0
"""Number of openings and of drawn frames, and time for which frames are counted."""

BOX = "document.querySelector('.view.current .scene')"

FIRST = """new MutationObserver((_, watch) => {
  if (!document.querySelector("[data-frames]")) return;
  window.drawn ??= performance.now();
  watch.disconnect();
}).observe(document, { subtree: true, attributes: true, attributeFilter: ["data-frames"] });"""

FRAME = f"""(async () => {{
  const {{ viewer }} = {BOX}, context = viewer.drawing.renderer?.getContext();
  viewer.playing = true;
  for (let i = 0; i < {FRAMES}; i += 1) {{
    viewer.time = (viewer.horizon * i) / {FRAMES};
    for (const listener of viewer.listeners) listener();
    viewer.draw();
    context?.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
  }}
  viewer.playing = false;
}})()"""

PLAYED = f"""(async () => {{
  const {{ viewer }} = {BOX}, count = () => Number(viewer.element.dataset.frames);
  viewer.play();
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  await wait(1000);
  const [before, began] = [count(), performance.now()];
  await wait({1000 * SECONDS});
  return (1000 * (count() - before)) / (performance.now() - began);
}})()"""


def opened(tab: Tab, address: str) -> float:
    """Open a page, and return the milliseconds from navigation to its first picture."""
    tab.send("Page.addScriptToEvaluateOnNewDocument", source=FIRST)
    tab.window(1440, 900)
    tab.open(address)
    tab.until("window.drawn")
    return float(tab.run("window.drawn"))


def seconds(browser: Browser) -> tuple[float, float]:
    """Return the processor time of the processes that run scripts, and of the one that draws."""
    processes = browser.send("SystemInfo.getProcessInfo")["processInfo"]
    script, raster = (
        sum(one["cpuTime"] for one in processes if one["type"] == kind)
        for kind in ("renderer", "GPU")
    )
    return script, raster


def main(page: str, fragment: str = "") -> None:
    address = Path(page).absolute().as_uri() + (f"#{fragment}" if fragment else "")
    rows = []
    with headless_browser() as browser:
        for _ in range(OPENINGS):
            with browser.tab() as tab:
                began = seconds(browser)
                first = opened(tab, address)
                tab.run(f"{BOX}.viewer.set({{ playing: false }})")
                drawn = seconds(browser)
                tab.run(FRAME)
                frames = seconds(browser)
                rows.append((first, *np.subtract(drawn, began), *np.subtract(frames, drawn)))
        with browser.tab() as tab:
            opened(tab, address)
            rate = tab.run(PLAYED)
            bodies = tab.run(f"{BOX}.viewer.data.bodies.length")
    first, *costs = np.median(rows, axis=0)
    start, drawing, script, raster = 1e3 * np.array(costs)
    print(f"{page}: {Path(page).stat().st_size / 1e6:.2f} MB, {bodies} bodies")
    print(f"first drawing: {first:.0f} ms; script {start:.0f} ms, raster {drawing:.0f} ms")
    print(f"a frame: script {script / FRAMES:.1f} ms, raster {raster / FRAMES:.1f} ms")
    print(f"in motion: {rate:.1f} frames/s")


if __name__ == "__main__":
    main(*sys.argv[1:])

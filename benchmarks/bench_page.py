"""What a page's picture costs in a headless browser: first drawing, and each frame.

`python -m benchmarks.bench_page PAGE [FRAGMENT]` opens a page that `crosscheck run` wrote. Headless
browsers draw by software: `script` is the time of the page's own code, `raster` that of drawing.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

from tests.report.chromium import Tab, running

OPENINGS, SECONDS = 5, 3.0
"""Number of openings, and time for which frames are counted."""

BOX = "document.querySelector('.view.current .scene')"

FIRST = """new MutationObserver((_, watch) => {
  if (!document.querySelector("[data-frames]")) return;
  window.drawn ??= performance.now();
  watch.disconnect();
}).observe(document, { subtree: true, attributes: true, attributeFilter: ["data-frames"] });"""

COSTS = f"""(() => {{
  const {{ viewer }} = {BOX}, rows = [], context = viewer.drawing.renderer?.getContext();
  for (let i = 0; i < 20; i += 1) {{
    const began = performance.now();
    viewer.time = (viewer.horizon * i) / 20;
    for (const listener of viewer.listeners) listener();
    viewer.draw();
    const script = performance.now() - began;
    context?.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
    rows.push([script, performance.now() - began - script]);
  }}
  return rows;
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


def main(page: str, fragment: str = "") -> None:
    address = Path(page).absolute().as_uri() + (f"#{fragment}" if fragment else "")
    with tempfile.TemporaryDirectory() as folder, running(Path(folder)) as browser:
        times = []
        for _ in range(OPENINGS):
            with browser.tab() as tab:
                times.append(opened(tab, address))
                tab.run(f"{BOX}.viewer.set({{ playing: false }})")
                script, raster = map(statistics.median, zip(*tab.run(COSTS)[2:], strict=True))
        with browser.tab() as tab:
            opened(tab, address)
            frames = tab.run(PLAYED)
            bodies = tab.run(f"{BOX}.viewer.data.bodies.length")
    first, rest = times[0], statistics.median(times[1:])
    print(f"{page}: {Path(page).stat().st_size / 1e6:.2f} MB, {bodies} bodies")
    print(f"first drawing {first:.0f} ms in a new browser, {rest:.0f} ms later")
    print(f"a frame: script {script:.1f} ms, raster {raster:.1f} ms; {frames:.1f} frames/s")


if __name__ == "__main__":
    main(*sys.argv[1:])

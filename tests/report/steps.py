"""Shared parts of the browser's tests: addresses on the samples' page, and actions."""

import pytest

from tests.report.chromium import CHROMIUM, NAMES, Tab

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason=f"no browser found: {', '.join(NAMES)}")

CASE = "case-system_0/mujoco.xml/mujoco/free"
BOTH = "case-system_1/robot.urdf/pybullet/driven"
KINDS = {
    CASE: 10, "case-system_0/mujoco.xml/mujoco/large": 0,
    "case-system_0/robot.urdf/mujoco/driven": 9, BOTH: 14,
}  # fmt: skip
"""Plots of a case of one coordinate, of one that was not run, of one without linearization, of two.

The leading plot of errors is in two tabs.
"""
SYSTEM, DIAGNOSIS = "system-system_0", "diagnosis-system_0/mujoco.xml/mujoco"
TALL = 5000
"""A window in which every plot of a case is near: plots are drawn when they come near."""

BUILT = """(() => {
  const boxes = [...document.querySelectorAll(".view.current [data-pack]")];
  const figures = [...document.querySelectorAll(".view.current figure:has(.plot)")];
  return boxes.every((box) => /plots/.test(box.dataset.built ?? ""))
    && figures.every((figure) => figure.dataset.drawn);
})()"""
"""Script that tests whether everything in the view is drawn."""

HURRY = "(() => { const wait = setTimeout; window.setTimeout = (f, ms) => wait(f, ms / 5); })()"
"""Script that shortens the page's timers until it is reloaded."""

PLOTS = "[...document.querySelectorAll('.plot')].map((each) => each.plot).filter(Boolean)"
"""The plots that are drawn."""


def sound(tab: Tab, address: str) -> None:
    """Check that the page has no problems and requested only itself."""
    assert tab.problems == []
    assert {request.partition("#")[0] for request in tab.requests} <= {address}
    assert tab.run("document.documentElement.dataset.errors") is None
    assert tab.run("document.documentElement.dataset.blocked") is None


def shown(tab: Tab) -> list[str]:
    names: list[str] = tab.run(
        "[...document.querySelectorAll('.view')].filter(v => v.checkVisibility()).map(v => v.id)"
    )
    return names


def rows(tab: Tab) -> list[str]:
    script = "[...document.querySelectorAll('#cases tbody tr:not([hidden])')].map(r => r.innerText)"
    texts: list[str] = tab.run(script)
    return texts


def show_first_plot(tab: Tab) -> None:
    """Scroll to the first plot, if there is one, and wait until it is drawn."""
    if tab.run("document.querySelector('.view.current [data-pack]') !== null"):
        tab.until("document.querySelector('.view.current figure:has(.plot)')")
        tab.run("document.querySelector('.view.current .plot').scrollIntoView()")
        tab.until("document.querySelector('.view.current [data-drawn]')")


STOP = """((wanted) => {
  const at = document.activeElement, box = at.getBoundingClientRect(), style = getComputedStyle(at);
  const far = parseFloat(style.outlineOffset) + parseFloat(style.outlineWidth) / 2;
  const sides = (clip) => [box.left - far >= clip.left, box.right + far <= clip.right,
    box.top - far >= clip.top, box.bottom + far <= clip.bottom].filter(Boolean).length;
  const clips = [];
  for (let above = at.parentElement; above; above = above.parentElement) {
    if (getComputedStyle(above).overflowX !== "visible") clips.push(above.getBoundingClientRect());
  }
  const seen = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0
    && box.width > 0 && clips.every((clip) => sides(clip) > 1);
  return { name: at.outerHTML.slice(0, 160), found: at.matches(wanted), seen };
})"""
"""Script that describes the focused element: whether it matches and shows its outline."""


def tab_to(tab: Tab, wanted: str, limit: int = 60) -> None:
    """Press Tab until an element has the focus; each one on the way must show it."""
    names = []
    for _ in range(limit):
        tab.key("Tab", 9)
        stop = tab.run(f"{STOP}({wanted!r})")
        names.append(stop["name"])
        assert stop["seen"], f"no outline: {stop['name']}"
        if stop["found"]:
            return
    raise AssertionError(f"no stop {wanted} in {names}")

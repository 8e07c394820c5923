"""A headless Chromium, controlled by the DevTools protocol."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
CHROMIUM = next((path for name in NAMES if (path := shutil.which(name))), None)

PATIENCE = 20.0
"""Seconds until a wait fails: generous for slow machines, not for slow pages."""


ARRIVED = """(() => {
  const place = document.getElementById(decodeURIComponent(location.hash.slice(1)) || "overview");
  return place?.closest(".view")?.classList.contains("current") ?? true;
})()"""
"""Script that tests whether the view of the address is shown."""


class Tab:
    """One page with its problems and its requests."""

    def __init__(self, browser: Browser, session: str) -> None:
        self.browser = browser
        self.session = session
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.changed = False
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **params: Any) -> Any:
        return self.browser.send(method, self.session, **params)

    def open(self, address: str) -> None:
        """Load a page, or follow a fragment of the open one; wait until it is ready."""
        if self.changed:
            self.send("Page.navigate", url="about:blank")
        self.changed = False
        self.send("Page.navigate", url=address)
        self.until("document.documentElement?.dataset.ready === 'yes'")
        self.until(ARRIVED)

    def go(self, fragment: str) -> None:
        """Follow a permalink within the page."""
        self.run(f"location.hash = {json.dumps(fragment)}")
        self.until(f"decodeURIComponent(location.hash) === {json.dumps('#' + fragment)}")

    def run(self, script: str) -> Any:
        """Return the value of an expression, awaiting a promise."""
        response = self.send(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in response:
            raise AssertionError(f"{script}: {json.dumps(response['exceptionDetails'])[:600]}")
        return response["result"].get("value")

    def until(self, script: str) -> Any:
        """Wait until an expression is true, or an element."""
        message = f"{script}; {self.problems}"
        return self.browser.until(lambda: self.run(f"Boolean({script})"), message)

    def window(self, width: int = 1400, height: int = 900, **media: str) -> None:
        """Set the window's size and media, such as `scheme="dark"` or `media="print"`."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        features = [{"name": "prefers-color-scheme", "value": media.get("scheme", "light")}]
        self.send("Emulation.setEmulatedMedia", media=media.get("media", ""), features=features)

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start, button="left", clickCount=1, buttons=1)
        for share in (0.3, 0.7, 1.0):
            points = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", *points, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def key(self, key: str, code: int) -> None:
        typed = {"text": "\r"} if key == "Enter" else {}
        for kind, more in (("keyDown", typed), ("keyUp", {})):
            self.send(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key,
                windowsVirtualKeyCode=code,
                **more,
            )

    def heard(self, method: str, params: Any) -> None:
        match method:
            case "Runtime.exceptionThrown":
                self.problems.append(json.dumps(params["exceptionDetails"])[:600])
            case "Runtime.consoleAPICalled" if params["type"] in ("error", "warning", "assert"):
                self.problems.append(json.dumps(params["args"])[:600])
            case "Log.entryAdded" if params["entry"]["level"] in ("error", "warning"):
                self.problems.append(params["entry"]["text"])
            case "Network.requestWillBeSent":
                url = params["request"]["url"]
                # The page itself creates the content of blob and data addresses.
                self.requests += [] if url.startswith(("blob:", "data:")) else [url]


class Browser:
    """A running browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._tabs: dict[str, Tab] = {}

    def send(self, method: str, session: str | None = None, **params: Any) -> Any:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params}
        if session is not None:
            message["sessionId"] = session
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE))
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            tab = self._tabs.get(answer.get("sessionId", ""))
            if tab is not None and "method" in answer:
                tab.heard(answer["method"], answer["params"])

    def until(self, condition: Callable[[], Any], message: str) -> Any:
        end = time.monotonic() + PATIENCE
        while not (value := condition()):
            assert time.monotonic() < end, f"waited in vain for {message}"
            time.sleep(0.02)
        return value

    @contextmanager
    def tab(self, scripts: bool = True) -> Iterator[Tab]:
        """Open a new page in its own window; `scripts=False` disables JavaScript."""
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        tab = Tab(self, session)
        self._tabs[session] = tab
        tab.window()
        if not scripts:
            tab.send("Emulation.setScriptExecutionDisabled", value=True)
        try:
            yield tab
        finally:
            self.send("Target.closeTarget", targetId=target)


@contextmanager
def running(folder: Path) -> Iterator[Browser]:
    """Start a browser with a new profile in a folder; end it afterwards."""
    profile = folder / "profile"
    process = subprocess.Popen(
        [
            str(CHROMIUM),
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-unsafe-swiftshader",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            f"--user-data-dir={profile}",
            "--remote-debugging-port=0",
            "about:blank",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        port_file = profile / "DevToolsActivePort"
        end = time.monotonic() + PATIENCE
        while not (port_file.exists() and len(port_file.read_text().splitlines()) == 2):
            assert process.poll() is None, "the browser ended at once"
            assert time.monotonic() < end, "the browser did not start"
            time.sleep(0.05)
        port, path = port_file.read_text().splitlines()
        with connect(f"ws://127.0.0.1:{port}{path}", max_size=None, proxy=None) as socket:
            yield Browser(socket)
    finally:
        process.terminate()
        process.wait()

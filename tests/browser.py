"""A page in a headless Chromium, for tests: what it shows, what it says, what it asks for.

with a_page(size=(1280, 800)) as page:
    page.open("file:///tmp/report.html")
    assert page.complaints == []

It speaks the DevTools protocol over two pipes: no library, no open port, and a browser whose pipes
are gone ends by itself. https://chromedevtools.github.io/devtools-protocol/
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

ANSWER_S = 150.0
END_S = 10.0
POLL_S = 0.1
DRAG_STEPS = 10

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-extensions",
    "--no-default-browser-check", "--disable-dev-shm-usage", "--mute-audio", "--hide-scrollbars",
    "--force-device-scale-factor=1", "--remote-debugging-pipe",
)  # fmt: skip
WITHOUT_GRAPHICS = ("--disable-gpu",)
IN_SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")

KEYS = {
    "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Home": 36, "End": 35,
    "PageUp": 33, "PageDown": 34, "Enter": 13, "Escape": 27, "Tab": 9, " ": 32,
}  # fmt: skip
"""The codes of keys that are no letters."""


@contextmanager
def a_page(
    *, size: tuple[int, int] = (1280, 800), dark: bool = False, webgl: bool = False
) -> Iterator[Page]:
    """Start a browser with nothing in its memory, and hand out its page; it ends with the block.

    Without a Chromium on this machine the test is skipped, loudly.

    Args:
        size: Width and height of the page in CSS pixels.
        dark: What `prefers-color-scheme` says.
        webgl: With WebGL, drawn in software: slow.
    """
    binary = next(filter(None, map(shutil.which, NAMES)), None)
    if binary is None:
        problem = "there is no Chromium here: apt-get install -y --no-install-recommends chromium"
        warnings.warn(f"NO PAGE WAS CHECKED: {problem}", stacklevel=3)
        pytest.skip(problem)
    graphics = IN_SOFTWARE if webgl else WITHOUT_GRAPHICS
    with (
        tempfile.TemporaryDirectory(prefix="semmap-browser-", ignore_cleanup_errors=True) as home,
        _running([binary, *OPTIONS, *graphics, f"--user-data-dir={home}", "about:blank"]) as line,
    ):
        page = Page(line)
        page.resize(*size)
        page.prefer(dark=dark)
        yield page


class Page:
    """A page, and all that it said since the browser started."""

    def __init__(self, line: _Line) -> None:
        self._line = line
        target = line.ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        attach = {"targetId": target, "flatten": True}
        line.session = line.ask("Target.attachToTarget", attach)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            line.ask(f"{domain}.enable")
        line.ask("Page.setLifecycleEventsEnabled", {"enabled": True})

    def open(self, url: str, *, most_s: float = ANSWER_S) -> None:
        """Go to an address (file:// or http://) and return once that has loaded, and no other."""
        seen = len(self._line.events)
        asked = self._line.ask("Page.navigate", {"url": url})["loaderId"]
        deadline = time.monotonic() + most_s
        while not any(_is_loaded(event, asked) for event in self._line.events[seen:]):
            assert time.monotonic() < deadline, f"{url} did not load within {most_s:.0f} s"
            self._line.listen(POLL_S)
        self.let_draw()

    def let_draw(self) -> None:
        """Wait until what changed is on the screen: till then a click goes to what was there."""
        self.evaluate(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())))"
        )

    def evaluate(self, script: str) -> Any:
        """Return what a JavaScript expression gives, as JSON would; a promise is waited for."""
        asked = {"expression": script, "returnByValue": True, "awaitPromise": True}
        answer = self._line.ask("Runtime.evaluate", asked)
        assert "exceptionDetails" not in answer, _exception(answer["exceptionDetails"])
        return answer["result"].get("value")

    def wait_until(self, script: str, *, most_s: float = ANSWER_S) -> None:
        """Return once a JavaScript expression is true."""
        deadline = time.monotonic() + most_s
        while not self.evaluate(f"Boolean({script})"):
            assert time.monotonic() < deadline, f"not so within {most_s:.0f} s: {script}"
            self._line.listen(POLL_S)

    def wait(self, seconds: float) -> None:
        """Let it go on, listening to what it says."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._line.listen(left)

    @property
    def console(self) -> list[tuple[str, str]]:
        """All that was said, in order: (level, text); the browser's own words, too."""
        self._line.listen(0)
        return [said for event in self._line.events if (said := _said(event)) is not None]

    @property
    def complaints(self) -> list[str]:
        """Errors, warnings, exceptions that nobody caught, and requests that failed."""
        said = [f"{how}: {what}" for how, what in self.console if how in {"error", "warning"}]
        failed = [what for event in self._line.events if (what := _failure(event)) is not None]
        return said + failed

    @property
    def requests(self) -> list[str]:
        """The addresses that were asked for, in order; `data:` and `blob:` are within the page."""
        self._line.listen(0)
        asked = [e for e in self._line.events if e["method"] == "Network.requestWillBeSent"]
        urls = [event["params"]["request"]["url"] for event in asked]
        return [url for url in urls if not url.startswith(("data:", "blob:"))]

    def place(self, selector: str) -> tuple[float, float, float, float]:
        """Return where an element is, scrolled into view: left, top, width, height in pixels."""
        element = f"document.querySelector({selector!r})"
        self.evaluate(f"{element}.scrollIntoView({{block: 'nearest'}})")
        self.let_draw()
        box = self.evaluate(
            f"(b => [b.x, b.y, b.width, b.height])({element}.getBoundingClientRect())"
        )
        return tuple(box)

    def click(self, where: str | tuple[float, float]) -> None:
        """Click on the middle of an element (a CSS selector), or on a point."""
        x, y = self._middle(where) if isinstance(where, str) else where
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self._mouse(kind, x, y)

    def hover(self, where: str | tuple[float, float]) -> None:
        """Let the pointer stand there."""
        x, y = self._middle(where) if isinstance(where, str) else where
        self._mouse("mouseMoved", x, y)

    def drag(self, source: tuple[float, float], target: tuple[float, float]) -> None:
        """Press at one point, move, let go at another."""
        self._mouse("mouseMoved", *source)
        self._mouse("mousePressed", *source)
        for step in range(1, DRAG_STEPS + 1):
            share = step / DRAG_STEPS
            x, y = (a + share * (b - a) for a, b in zip(source, target, strict=True))
            self._mouse("mouseMoved", x, y, held=True)
        self._mouse("mouseReleased", *target)

    def press(self, *keys: str) -> None:
        """Press keys, one after the other: `ArrowRight`, `Tab`, `a`."""
        for key in keys:
            code = KEYS.get(key, ord(key.upper()[0]))
            pressed: dict[str, Any] = {"key": key, "windowsVirtualKeyCode": code}
            text = {"text": "\r" if key == "Enter" else key} if len(key) == 1 else {}
            self._line.ask("Input.dispatchKeyEvent", {"type": "keyDown", **pressed, **text})
            self._line.ask("Input.dispatchKeyEvent", {"type": "keyUp", **pressed})

    def resize(self, width: int, height: int) -> None:
        """Make the page so large, in CSS pixels."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._line.ask("Emulation.setDeviceMetricsOverride", metrics)

    def prefer(self, *, dark: bool) -> None:
        """Set what `prefers-color-scheme` says."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._line.ask("Emulation.setEmulatedMedia", {"media": "", "features": [scheme]})

    def go_offline(self) -> None:
        """Cut the page off from every network."""
        nothing = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
        self._line.ask("Network.emulateNetworkConditions", {"offline": True, **nothing})

    def screenshot(self, *, whole: bool = False) -> bytes:
        """Return what is seen as PNG; `whole`: beyond the window, too."""
        asked = {"format": "png", "captureBeyondViewport": whole}
        return base64.b64decode(self._line.ask("Page.captureScreenshot", asked)["data"])

    def pdf(self) -> bytes:
        """Return what would be printed, on A4 with backgrounds."""
        paper = {"paperWidth": 8.27, "paperHeight": 11.69, "printBackground": True}
        return base64.b64decode(self._line.ask("Page.printToPDF", paper)["data"])

    def _middle(self, selector: str) -> tuple[float, float]:
        left, top, width, height = self.place(selector)
        return left + width / 2, top + height / 2

    def _mouse(self, kind: str, x: float, y: float, *, held: bool = False) -> None:
        held = held or kind == "mousePressed"
        button = "none" if kind == "mouseMoved" and not held else "left"
        event = {"type": kind, "x": x, "y": y, "button": button, "buttons": int(held)}
        self._line.ask("Input.dispatchMouseEvent", {**event, "clickCount": int(button == "left")})


class _Line:
    """The two pipes to a browser: JSON messages, each ended by a zero byte."""

    def __init__(self, process: subprocess.Popen[bytes], sink: int, source: int) -> None:
        self.process = process
        self.session: str | None = None
        self.events: list[dict[str, Any]] = []
        self._answers: dict[int, dict[str, Any]] = {}
        self._sink, self._source = sink, source
        self._asked = 0
        self._rest = b""

    def ask(self, method: str, params: dict[str, Any] | None = None) -> dict[str, Any]:
        """Return the answer to a command; what happens meanwhile is kept in `events`."""
        self._asked += 1
        message = {"id": self._asked, "method": method, "params": params or {}}
        if self.session is not None:
            message["sessionId"] = self.session
        with os.fdopen(os.dup(self._sink), "wb") as pipe:
            pipe.write(json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + ANSWER_S
        while self._asked not in self._answers:
            assert time.monotonic() < deadline, f"no answer to {method} within {ANSWER_S:.0f} s"
            self.listen(POLL_S)
        answer = self._answers.pop(self._asked)
        assert "error" not in answer, f"{method}: {answer['error']}"
        result: dict[str, Any] = answer["result"]
        return result

    def listen(self, seconds: float) -> None:
        """Take in what has come, and wait so long for something to come."""
        while select.select([self._source], [], [], seconds)[0]:
            piece = os.read(self._source, 2**20)
            assert piece, f"the browser ended, with {self.process.wait(END_S)}"
            *messages, self._rest = (self._rest + piece).split(b"\0")
            for message in map(json.loads, messages):
                if "id" in message:
                    self._answers[message["id"]] = message
                else:
                    self.events.append(message)
            seconds = 0


@contextmanager
def _running(command: Sequence[str]) -> Iterator[_Line]:
    """Start a browser that reads commands from its descriptor 3 and answers on 4."""
    (commands, sink), (source, answers) = os.pipe(), os.pipe()
    # A shell can give descriptors their numbers; /proc, because dash knows those of one digit only.
    descriptors = f'exec "$0" "$@" 3</proc/self/fd/{commands} 4>/proc/self/fd/{answers}'
    process = subprocess.Popen(
        ["/bin/sh", "-c", descriptors, *command],
        pass_fds=(commands, answers), start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(commands)
    os.close(answers)
    try:
        yield _Line(process, sink, source)
    finally:
        os.close(sink)  # which is how it is told to end
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            warnings.warn("the browser had to be killed", stacklevel=2)
        _kill_group(process)
        os.close(source)


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """End what is left of a process and its children, of which it is the group's first."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _is_loaded(event: dict[str, Any], loader: str) -> bool:
    """Tell whether an event says that what a loader was asked for is there."""
    said = event["params"]
    return event["method"] == "Page.lifecycleEvent" and (said["loaderId"], said["name"]) == (
        loader,
        "load",
    )


def _said(event: dict[str, Any]) -> tuple[str, str] | None:
    params = event["params"]
    if event["method"] == "Runtime.consoleAPICalled":
        words = [str(a.get("value", a.get("description", a["type"]))) for a in params["args"]]
        return params["type"], " ".join(words)
    if event["method"] == "Runtime.exceptionThrown":
        return "error", _exception(params["exceptionDetails"])
    if event["method"] == "Log.entryAdded":
        return params["entry"]["level"], params["entry"]["text"]
    return None


def _exception(details: dict[str, Any]) -> str:
    what = details.get("exception", {}).get("description", "")
    return f"{details['text']} {what} (line {details['lineNumber'] + 1})"


def _failure(event: dict[str, Any]) -> str | None:
    params = event["params"]
    if event["method"] == "Network.loadingFailed" and not params.get("canceled"):
        return f"failed: {params['type']}: {params['errorText']}"
    if event["method"] == "Network.responseReceived" and params["response"]["status"] >= 400:
        return f"failed: {params['response']['url']}: {params['response']['status']}"
    return None


def as_url(path: Path) -> str:
    """Return the file:// address of a file."""
    return path.resolve().as_uri()

"""A headless Chromium that tests drive over its debugging protocol, with a profile of its own and software WebGL."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import WebSocketClientConnection, websocket_connect

NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    *("--headless", "--no-first-run", "--disable-gpu", "--disable-quic", "--disable-sync", "--mute-audio"),
    *("--disable-background-networking", "--disable-component-update", "--disable-extensions", "--hide-scrollbars"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0"),
)
PATIENCE = 60.0  # s
QUIET = "GPU stall due to ReadPixels"  # said of software WebGL whenever a screenshot is taken


def program() -> str | None:
    """The path of Chromium; None if it is missing."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One page of a browser."""

    def __init__(self, process: subprocess.Popen[bytes], port: int) -> None:
        self.process = process
        self.events: list[dict[str, Any]] = []
        self._count = 0
        self._loop = asyncio.new_event_loop()
        self._socket: WebSocketClientConnection = self._loop.run_until_complete(self._connected(port))
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    async def _connected(self, port: int) -> WebSocketClientConnection:
        reply = await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/json")
        (page,) = [target for target in json.loads(reply.body) if target["type"] == "page"]
        return await websocket_connect(page["webSocketDebuggerUrl"], max_message_size=2**30)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a command of the protocol."""
        return self._loop.run_until_complete(asyncio.wait_for(self._called(method, parameters), PATIENCE))

    async def _called(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._count += 1
        await self._socket.write_message(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            reply = json.loads(await self._socket.read_message() or "{}")
            if reply.get("id") == self._count:
                assert "error" not in reply, reply
                return reply["result"]
            self.events.append(reply)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript in the page, awaited."""
        reply = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in reply, reply
        return reply["result"].get("value")

    def text(self, element: str) -> str:
        """The text of the element with this id."""
        return str(self.evaluate(f"document.getElementById('{element}')?.innerText ?? ''"))

    def wait(self, expression: str) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + PATIENCE
        while not self.evaluate(f"(() => {{ try {{ return !!({expression}); }} catch {{ return false; }} }})()"):
            assert time.monotonic() < until, f"{expression}: {self.text('error')} {self.problems()}"
            time.sleep(0.05)

    def open(self, address: str, width: int = 1280, height: int = 900) -> None:
        """Open a page in a window of this size and wait until it shows the nodes."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.call("Page.navigate", url=address)
        self.wait("document.documentElement.dataset.drawn === 'yes'")

    def change(self, element: str, value: object, event: str = "input") -> None:
        """Give an element a value as a user would."""
        self.evaluate(
            f"(() => {{ const it = document.getElementById('{element}'); it.value = {json.dumps(value)};"
            f" it.dispatchEvent(new Event('{event}')); }})()"
        )

    def click(self, x: float, y: float) -> None:
        """Click at a place of the window."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def pixels(self) -> NDArray[np.uint8]:
        """The window (rows, columns, 3)."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def problems(self) -> list[str]:
        """Errors and warnings of the page's console so far."""
        self.evaluate("0")  # events come before its reply
        said = [
            json.dumps(event["params"])
            for event in self.events
            if event["method"] in ("Runtime.exceptionThrown", "Log.entryAdded")
            or (event["method"] == "Runtime.consoleAPICalled" and event["params"]["type"] in ("error", "warning"))
        ]
        return [text for text in said if QUIET not in text]

    def requests(self) -> list[str]:
        """The addresses that were asked for so far."""
        sent = (event for event in self.events if event["method"] == "Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in sent]

    def seconds(self) -> float:
        """CPU seconds of the browser's processes so far, on all cores."""
        children: dict[int, list[int]] = {}
        ticks: dict[int, int] = {}
        for file in Path("/proc").glob("[0-9]*/stat"):
            try:
                words = file.read_text().rpartition(")")[2].split()
            except OSError:  # it has ended
                continue
            pid = int(file.parent.name)
            children.setdefault(int(words[1]), []).append(pid)
            ticks[pid] = int(words[11]) + int(words[12])
        family = [self.process.pid]
        for pid in family:
            family += children.get(pid, [])
        return sum(ticks.get(pid, 0) for pid in family) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        """End the connection."""
        self._socket.close()
        self._loop.close()


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser that ends with the context."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = [*OPTIONS, f"--user-data-dir={profile}", *["--no-sandbox"] * (os.geteuid() == 0)]
        command = [program() or "chromium", *options, "about:blank"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            try:
                file, until = Path(profile) / "DevToolsActivePort", time.monotonic() + PATIENCE
                while not file.exists() or "\n" not in file.read_text():
                    assert time.monotonic() < until
                    assert process.poll() is None
                    time.sleep(0.05)
                page = Browser(process, int(file.read_text().split()[0]))
                yield page
                page.close()
            finally:
                process.terminate()

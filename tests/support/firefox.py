"""Pages in headless Firefox, by its own protocol (WebDriver BiDi): Debian has no geckodriver.

selenium brings the connection; the browser itself listens on a port of this machine.
"""

import base64
import json
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tests.support.browser import Browser, need

PROGRAM = "firefox-esr"
TIMEOUT = 60  # s
# nothing leaves this machine: a proxy that does not exist, for other machines
SETTINGS = {
    "network.proxy.type": 1,
    "network.proxy.http": "127.0.0.1",
    "network.proxy.http_port": 9,
}
SETTINGS |= {"network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9}
# of the browser, not of the page
PREFERENCES = """
Services.prefs.setIntPref('layout.css.prefers-color-scheme.content-override', arguments[0] ? 0 : 1);
Services.prefs.setIntPref('ui.prefersReducedMotion', Number(arguments[1]));
"""


class Firefox(Browser):
    """A tab of Firefox: what `Browser` says of a page, without selenium's driver."""

    def __init__(self, connection: Any) -> None:
        super().__init__(driver=None)
        self._connection = connection
        self._events: list[tuple[str, dict[str, Any]]] = []
        self._command("session.new", {"capabilities": {}})
        for name in ("log.entryAdded", "network.beforeRequestSent"):
            event = SimpleNamespace(event_class=name, from_json=lambda content: content)
            connection.add_callback(
                event, lambda content, name=name: self._events.append((name, content))
            )
            self._command("session.subscribe", {"events": [name]})
        self._tab, self._window = (
            self._command("browsingContext.getTree", {"moz:scope": scope})["contexts"][0]["context"]
            for scope in ("content", "chrome")
        )

    def _show(
        self, width: int, height: int, dark: bool, reduced_motion: bool, scale: float
    ) -> None:
        view = {"viewport": {"width": width, "height": height}, "devicePixelRatio": scale}
        self._command("browsingContext.setViewport", {"context": self._tab, **view})
        self._run(self._window, PREFERENCES, dark, reduced_motion)
        for query, wanted in (
            ("color-scheme: dark", dark),
            ("reduced-motion: reduce", reduced_motion),
        ):
            self.wait(f"matchMedia('(prefers-{query})').matches === {json.dumps(wanted)}")

    def _go_to(self, address: str) -> None:
        self._command(
            "browsingContext.navigate", {"context": self._tab, "url": address, "wait": "complete"}
        )

    def update(self) -> None:
        self.run("return 0")  # events of what was done before have arrived
        events, self._events = self._events, []
        for name, content in events:
            if name == "network.beforeRequestSent":
                self.loaded.append(content["request"]["url"])
            elif content["level"] in ("error", "warn"):
                self.errors.append(f"{content['level']}: {content['text']}")
        self.requests = self._not_local()

    def run(self, script: str, *arguments: Any) -> Any:
        return self._run(self._tab, script, *arguments)

    def _run(self, context: str, script: str, *arguments: Any) -> Any:
        declaration = (
            "async text => JSON.stringify("
            f"(await (function() {{ {script} }}).apply(null, JSON.parse(text))) ?? null)"
        )
        answer = self._command(
            "script.callFunction",
            {
                "functionDeclaration": declaration,
                "arguments": [{"type": "string", "value": json.dumps(arguments)}],
                "target": {"context": context},
                "awaitPromise": True,
            },
        )
        assert answer["type"] == "success", answer["exceptionDetails"]["text"]
        return json.loads(answer["result"]["value"])

    def screenshot(self, path: Path, *, whole: bool = False) -> None:
        part = {"context": self._tab, "origin": "document" if whole else "viewport"}
        answer = self._command("browsingContext.captureScreenshot", part)
        path.write_bytes(base64.b64decode(answer["data"]))

    def _command(self, name: str, parameters: dict[str, Any]) -> Any:
        answer = self._connection.send_cmd(name, parameters)
        assert answer["type"] == "success", (name, answer)
        return answer["result"]


@contextmanager
def opened() -> Iterator[Firefox]:
    """A browser; a skipped test where it is not installed, a failed one in CI."""
    need(PROGRAM)

    from selenium.webdriver.remote.websocket_connection import WebSocketConnection

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = (f"user_pref({json.dumps(k)}, {json.dumps(v)});\n" for k, v in SETTINGS.items())
        (Path(profile) / "user.js").write_text("".join(lines), encoding="utf-8")
        command = [PROGRAM, "--headless", "--no-remote", "--profile", profile]
        command += ["--remote-debugging-port", "0", "--remote-allow-system-access"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            connection = WebSocketConnection(_address(Path(profile), process), TIMEOUT, 0.002)
            try:
                yield Firefox(connection)
            finally:
                connection.close()
        finally:
            process.terminate()
            process.wait()


def _address(profile: Path, process: subprocess.Popen) -> str:
    """Where the browser listens, once it says so in its profile."""
    file, end = profile / "WebDriverBiDiServer.json", time.monotonic() + TIMEOUT
    while time.monotonic() < end and process.poll() is None:
        with suppress(OSError, ValueError):
            server = json.loads(file.read_text(encoding="utf-8"))
            return f"ws://{server['ws_host']}:{server['ws_port']}/session"
        time.sleep(0.02)
    raise RuntimeError(f"{PROGRAM} does not start")

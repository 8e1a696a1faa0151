"""Pages in headless Chromium and Firefox, without network: what they show, request and report."""

import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tests.support.missing import missing

PROGRAMS = ("chromium", "chromedriver")
TIMEOUT = 300  # s, for a page or a browser on a busy machine
# what a page may load: files beside it and what it holds itself
LOCAL = ("file:", "data:", "blob:", "about:")
OPTIONS = (
    "--headless=new",
    "--no-sandbox",  # the tests may run as root
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)


class Browser:
    """A tab of Chromium; `driver` is selenium's, for what is not here."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self.errors: list[str] = []  # of the console since the page was opened
        self.requests: list[str] = []  # addresses asked for since then that are not local
        self.loaded: list[str] = []  # all addresses asked for since then

    def open(
        self,
        page: Path,
        *,
        width: int = 1000,
        height: int = 800,
        dark: bool = False,
        reduced_motion: bool = False,
        scale: float = 1.0,
        fragment: str = "",
    ) -> None:
        """Open a file in a view of `width` and `height` pixels of CSS, and wait until it is there.

        `scale` is the number of the screen's pixels for one of CSS.
        """
        self._show(width, height, dark, reduced_motion, scale)
        self._go_to("about:blank")
        self.update()
        self.errors.clear()
        self.requests.clear()
        self.loaded.clear()
        self._go_to(page.absolute().as_uri() + fragment)
        self.update()

    def _show(
        self, width: int, height: int, dark: bool, reduced_motion: bool, scale: float
    ) -> None:
        self._command(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False},
        )
        features = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if reduced_motion else "no-preference",
        }
        self._command(
            "Emulation.setEmulatedMedia",
            {"features": [{"name": name, "value": value} for name, value in features.items()]},
        )

    def _go_to(self, address: str) -> None:
        self.driver.get(address)

    def update(self) -> None:
        """Take what happened since the last call into `errors`, `loaded` and `requests`."""
        self.errors += [
            f"{entry['level']}: {entry['message']}"
            for entry in self.driver.get_log("browser")
            if entry["level"] in ("SEVERE", "WARNING")
        ]
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self.loaded.append(message["params"]["request"]["url"])
            elif message["method"] == "Network.webSocketCreated":
                self.loaded.append(message["params"]["url"])
        self.requests = self._not_local()

    def _not_local(self) -> list[str]:
        return [url for url in self.loaded if not url.startswith(LOCAL)]

    def check_quiet(self) -> None:
        """Fail if the page wrote an error or a warning to the console, or asked the network."""
        self.update()
        assert not self.errors, self.errors
        assert not self.requests, self.requests

    def run(self, script: str, *arguments: Any) -> Any:
        """Value of the body of a function in JavaScript; `arguments` are its arguments[i]."""
        return self.driver.execute_script(script, *arguments)

    def keys(self, selector: str, *keys: str) -> None:
        """Press keys (of selenium's Keys, or characters) in the element of a CSS selector."""
        element = self.driver.find_element("css selector", selector)
        self.run("arguments[0].focus()", element)
        for key in keys:
            element.send_keys(key)

    def wait(self, condition: str) -> Any:
        """Wait until an expression in JavaScript is true; its value."""
        from selenium.webdriver.support.ui import WebDriverWait

        message = f"not within {TIMEOUT} s: {condition}"
        wait = WebDriverWait(self.driver, TIMEOUT, poll_frequency=0.02)
        return wait.until(lambda _: self.run(f"return {condition}"), message)

    def overflow(self) -> int:
        """Pixels of CSS by which the page is wider than its view."""
        return self.run(
            "const root = document.documentElement; return root.scrollWidth - root.clientWidth"
        )

    def violations(self, contrast: bool = True) -> list[str]:
        """What axe-core finds against the accessibility guidelines (WCAG).

        Without `contrast`, which takes seconds on a long page, colours are not looked at.
        """
        self.run((files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8"))
        rules = {"color-contrast": {"enabled": contrast}}
        result = self.run("return axe.run({rules: arguments[0]})", rules)
        return [
            f"{found['id']}: {found['help']}: {node['html'][:200]}: {node.get('failureSummary')}"
            for found in result["violations"]
            for node in found["nodes"]
        ]

    def _command(self, name: str, parameters: dict[str, Any]) -> Any:
        return self.driver.execute_cdp_cmd(name, parameters)


def need(*programs: str) -> None:
    """Skip the test where a program is not installed; fail it in CI."""
    absent = [program for program in programs if shutil.which(program) is None]
    if absent:
        missing(f"missing: {' and '.join(absent)}: ./setup.sh --platforms installs them")


@contextmanager
def opened() -> Iterator[Browser]:
    """A browser; a skipped test where it is not installed, a failed one in CI."""
    need(*PROGRAMS)

    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for option in OPTIONS:
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.set_script_timeout(TIMEOUT)
    driver.set_page_load_timeout(TIMEOUT)
    try:
        yield Browser(driver)
    finally:
        driver.quit()


# ---- Firefox -------------------------------------------------------------------------------------
# By its own protocol (WebDriver BiDi), since Debian has no geckodriver: selenium brings the
# connection, the browser listens on a port of this machine.

FIREFOX = "firefox-esr"
# nothing leaves this machine: a proxy that does not exist, for other machines
SETTINGS = {
    "network.proxy.type": 1,
    "network.proxy.http": "127.0.0.1",
    "network.proxy.http_port": 9,
}
SETTINGS |= {"network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9}
INVALID = "Invalid markup: Incorrect number of children"
LAY_OUT = """
const {style} = document.documentElement;
for (style.display of ['none', '']) document.documentElement.getBoundingClientRect();
"""
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
        # On a busy machine Firefox lays a formula out before it has read it as a whole, and says
        # that parts are missing: ask again now.
        self.update()
        self.errors = [text for text in self.errors if INVALID not in text]
        self.run(LAY_OUT)

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

    def _command(self, name: str, parameters: dict[str, Any]) -> Any:
        answer = self._connection.send_cmd(name, parameters)
        assert answer["type"] == "success", (name, answer)
        return answer["result"]


@contextmanager
def opened_firefox() -> Iterator[Firefox]:
    """A browser; a skipped test where it is not installed, a failed one in CI."""
    need(FIREFOX)

    from selenium.webdriver.remote.websocket_connection import WebSocketConnection

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = (f"user_pref({json.dumps(k)}, {json.dumps(v)});\n" for k, v in SETTINGS.items())
        (Path(profile) / "user.js").write_text("".join(lines), encoding="utf-8")
        command = [FIREFOX, "--headless", "--no-remote", "--profile", profile]
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
    raise RuntimeError(f"{FIREFOX} does not start")

"""The playground as tests drive it."""

import base64
from pathlib import Path
from typing import Any

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from tests.support.browser import Browser

IN_PAGE = Path(__file__).with_name("in_page.js").read_text(encoding="utf-8")


class OpenedPage:
    """The page in a browser, paused at its start; its Playground is window.tested."""

    def __init__(self, browser: Browser, path: Path, **view: Any) -> None:
        self.browser = browser
        browser.open(path, **view)
        self.was_running = browser.run("""
            return playground.then(it => {
              window.tested = it;
              const {isRunning} = it;
              it.play(false);
              it.reset();
              return isRunning;
            });
        """)

    def run(self, script: str, *arguments: Any) -> Any:
        """Value of the body of a function that knows what stands in in_page.js."""
        return self.browser.run(IN_PAGE + script, *arguments)

    def call(self, function: str, *arguments: Any) -> Any:
        """Value of a function of in_page.js."""
        return self.run(f"return {function}(...arguments)", *arguments)

    def doubles(self, function: str, *arguments: Any) -> bytes:
        """Bytes of the doubles in the array that a function of in_page.js returns."""
        return base64.b64decode(self.run(f"return encoded({function}(...arguments))", *arguments))

    def value(self, name: str) -> float:
        """Value of a variable of the plant."""
        return self.run("return plant.get(arguments[0])", name)

    def text(self, selector: str) -> str:
        return self.browser.run("return document.querySelector(arguments[0]).textContent", selector)


# ---- Controls, used as a user does ---------------------------------------------------------------


def find(opened: OpenedPage, selector: str):
    return opened.browser.driver.find_element(By.CSS_SELECTOR, selector)


def click(opened: OpenedPage, selector: str) -> None:
    opened.browser.run("document.querySelector(arguments[0]).click()", selector)


def choose(opened: OpenedPage, selector: str, text: str) -> None:
    opened.browser.run(
        "const box = document.querySelector(arguments[0]);"
        "box.value = [...box.options].find(option => option.text === arguments[1]).value;"
        "box.dispatchEvent(new Event('change'))",
        selector,
        text,
    )


def type_number(opened: OpenedPage, identifier: str, text: str) -> None:
    """Type a value into the number field beside a slider."""
    opened.browser.run("document.querySelectorAll('details').forEach(it => { it.open = true; })")
    field = find(opened, f"#{identifier} + input")
    field.send_keys(Keys.CONTROL + "a")
    field.send_keys(text, Keys.ENTER)

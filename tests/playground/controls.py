"""The controls of the page, used as a user does."""

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from tests.playground.opened_page import OpenedPage


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

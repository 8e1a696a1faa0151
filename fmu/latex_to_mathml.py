"""Converts the formulas of a page from LaTeX to MathML, and refuses those that would show wrong."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import pairwise

from latex2mathml.converter import convert

NAMESPACE = "http://www.w3.org/1998/Math/MathML"

# elements that need an exact number of children: with fewer of them the LaTeX was incomplete
CHILDREN = dict.fromkeys(("mfrac", "mroot", "msub", "msup", "munder", "mover"), 2)
CHILDREN |= dict.fromkeys(("msubsup", "munderover"), 3)

DOTS = ("\u02d9", "\u00a8")  # of \dot and \ddot
MINUS = "\u2212"
CLOSING = (")", "]", "}", "|", "!")


class FormulaError(Exception):
    """Why a formula does not convert."""


def mathml(latex: str, display: str) -> str:
    """A formula without its dollar signs as a math element; `display` is "inline" or "block".

    FormulaError if it does not convert: the converter passes on unknown commands and does not
    notice a missing argument, so its result is searched for signs of either.
    """
    try:
        root = ET.fromstring(convert(latex, display=display))
    except Exception as error:  # noqa: BLE001 (those of the converter have no common base)
        raise FormulaError(str(error) or type(error).__name__) from None
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{NAMESPACE}}}")
    for element in root.iter():
        check(element)
        improve(element)
    root.set("xmlns", NAMESPACE)
    return ET.tostring(root, encoding="unicode")


def check(element: ET.Element) -> None:
    """Refuse what is left over from LaTeX that the converter did not understand."""
    text = element.text or ""
    if element.tag == "mi" and text.startswith("\\"):
        raise FormulaError(f"{text} is unknown")
    if element.tag == "mi" and text in ("&", "{", "}"):
        raise FormulaError(f"{text} is out of place")
    if len(element) != CHILDREN.get(element.tag, len(element)):
        raise FormulaError("an argument is missing")


def improve(element: ET.Element) -> None:
    """Set what the converter leaves out: dots are accents, and a sign is not a difference."""
    if element.tag == "mover" and element[1].text in DOTS:
        element.set("accent", "true")
    for before, child in pairwise(element):
        after_operator = before.tag == "mo" and before.text not in CLOSING
        if child.text == MINUS and after_operator:
            child.set("form", "prefix")

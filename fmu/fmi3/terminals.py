"""Writes terminalsAndIcons.xml of FMI 3.0 (section 2.4.9 of the specification)."""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from declaration.load import Declaration
from declaration.schema import Terminal
from description_parts import document

HALF_WIDTH = 100.0  # of the icon, in units of the coordinate system
MM_PER_UNIT = 0.1
PNG_START = b"\x89PNG\r\n\x1a\n"


def terminals_and_icons(declaration: Declaration) -> str:
    """Text of terminalsAndIcons.xml; the icon is model.png beside the declaration, if it exists."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    icon = declaration.path.with_name("model.png")
    if icon.is_file():
        add_icon(root, icon)
    if declaration.terminals:
        add_terminals(ET.SubElement(root, "Terminals"), declaration.terminals)
    return document(root)


def add_icon(root: ET.Element, icon: Path) -> None:
    """Write GraphicalRepresentation: the icon fills the coordinate system and keeps its shape."""
    width, height = png_size(icon)
    half_height = HALF_WIDTH * height / width
    box = {"x1": -HALF_WIDTH, "y1": -half_height, "x2": HALF_WIDTH, "y2": half_height}
    corners = {key: repr(value) for key, value in box.items()}
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    ET.SubElement(
        graphics, "CoordinateSystem", corners, suggestedScalingFactorTo_mm=repr(MM_PER_UNIT)
    )
    ET.SubElement(graphics, "Icon", corners)


def png_size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    if len(head) < 24 or not head.startswith(PNG_START):
        raise OSError(f"{path}: is not a PNG file")
    return struct.unpack(">II", head[16:])


def add_terminals(parent: ET.Element, terminals: Mapping[str, Terminal]) -> None:
    """Write terminals, each with its members and the terminals in it."""
    for name, terminal in terminals.items():
        element = ET.SubElement(
            parent,
            "Terminal",
            name=name,
            matchingRule=terminal.rule,
            description=terminal.description,
        )
        for kind, member, variable in terminal.members:
            ET.SubElement(
                element,
                "TerminalMemberVariable",
                variableName=variable,
                memberName=member,
                variableKind=kind,
            )
        add_terminals(element, terminal.terminals)

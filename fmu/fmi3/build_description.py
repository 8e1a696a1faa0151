"""Writes buildDescription.xml of FMI 3.0 (section 2.5.1.4.1): how to compile sources/."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from description_parts import document


def build_description(identifier: str, sources: Sequence[str]) -> str:
    """Text of buildDescription.xml; `sources`: files beside it, each compiled by itself."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    return document(root)

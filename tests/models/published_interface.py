"""What importers know of the FMUs: published_interface.csv, from those of commit 9ebfe1f2.

This writes it again, after a release that changes the interface on purpose:

    build/venv/bin/python -m tests.models.published_interface build
"""

import csv
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from zipfile import ZipFile

from tests.support.paths import EVERY

TABLE = Path(__file__).with_suffix(".csv")
PLACES = {"2": "", "3": "fmi3"}  # of the FMUs of each version, below build/
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
OLD = {"Real": "Float64", "Integer": "Int32", "SimpleType": "EnumerationType"}  # tags of FMI 2.0
ONLY_IN_FMI2 = " in FMI 2.0"  # behind the name of a column: the text there, or NOTHING
NOTHING = "-"
UNKNOWNS = {  # lists of ModelStructure in both versions, and their columns
    "Outputs": "output", "Output": "output",
    "Derivatives": "state derivative", "ContinuousStateDerivative": "state derivative",
    "InitialUnknowns": "initial unknown", "InitialUnknown": "initial unknown",
    "EventIndicator": "event indicator",
}  # fmt: skip
ONLY_IN_FMI3 = {"intermediateUpdate", "event indicator"}
# what is new in each build, what no importer acts on, and names, which are keys here
IGNORED = {"guid", "instantiationToken", "generationTool", "fmiVersion", "version"}
IGNORED |= {"author", "copyright", "license", "name", "memberName"}

Row = dict[str, str]  # column to text; without those that are empty
Interface = dict[str, Row]  # by the name of a variable, or the path of another part


def of_fmu(path: Path) -> Interface:
    """Variables by name, all other parts by a path that begins with "/"."""
    with ZipFile(path) as archive:
        texts = [archive.read("modelDescription.xml").decode()]
        texts += [archive.read(TERMINALS).decode()] if TERMINALS in archive.namelist() else []
    return of_texts(*texts)


def of_texts(description: str, terminals: str = "") -> Interface:
    """Return the interface of a modelDescription.xml and a terminalsAndIcons.xml."""
    root = ElementTree.fromstring(description)
    found = _variables(root)
    found["/"] = {"attributes": _attributes(root)}
    for part in root:
        if part.tag not in ("ModelVariables", "ModelStructure"):
            found |= _parts((part,))
    if terminals:
        found |= _parts(ElementTree.fromstring(terminals).iter("Terminals"))
    references = {name: row["valueReference"] for name, row in found.items() if name[0] != "/"}
    name_of = {reference: name for name, reference in reversed(references.items())}
    if root.get("fmiVersion") == "2.0":  # there, positions in the list stand for variables
        name_of = {str(i): name for i, name in enumerate(references, 1)}
    for row in found.values():
        if "derivative" in row:
            row["derivative"] = name_of[row["derivative"]]
    for column, unknown in _unknowns(root):
        name = name_of[unknown.get("index") or unknown.attrib["valueReference"]]
        dependencies = unknown.get("dependencies", "all").split() or ["none"]
        kinds = unknown.get("dependenciesKind", "").split()
        numbers = [references.get(name_of.get(number, ""), number) for number in dependencies]
        found[name][column] = " ".join(numbers + kinds)
        order = found.setdefault(f"/order/{column}", {"attributes": ""})
        order["attributes"] = f"{order['attributes']} {name}".strip()
    return found


def _variables(root: Element) -> Interface:
    types = {type.get("name"): type for type in root.iter("Float64Type")}
    found = {}
    for variable in root.iterfind("ModelVariables/*"):
        own = dict(variable.attrib)
        of_type = variable[0] if variable.tag == "ScalarVariable" else variable
        own |= of_type.attrib | {"type": OLD.get(of_type.tag, of_type.tag)}
        if own.get("declaredType") in types:
            own |= types[own.pop("declaredType")].attrib | {"name": own["name"]}
        found[own.pop("name")] = own
    return found


def _unknowns(root: Element) -> Iterator[tuple[str, Element]]:
    for part in root.iterfind("ModelStructure/*"):
        for unknown in part if part.tag.endswith("s") else (part,):
            yield UNKNOWNS[part.tag], unknown


def _parts(elements: Iterable[Element], path: str = "") -> Interface:
    found: Interface = {}
    for element in elements:
        if element.tag == "Float64Type":  # its variables have its attributes
            continue
        name = element.get("name") or element.get("memberName")
        own = f"{path}/{OLD.get(element.tag, element.tag)} {name}" if name else path
        text = _attributes(element)
        if text or not len(element):
            found[own if name else f"{own}/{element.tag}"] = {"attributes": text} if text else {}
        found |= _parts(element, own)
    return found


def _attributes(element: Element) -> str:
    return " ".join(f"{k}={v!r}" for k, v in sorted(element.attrib.items()) if k not in IGNORED)


def published(name: str, version: str) -> Interface:
    """Return the published interface of an FMU."""
    found: Interface = {}
    with TABLE.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row.pop("fmu") == name and version in row.pop("fmi"):
                of_fmi2 = {c: row.pop(c) for c in [*row] if c.endswith(ONLY_IN_FMI2)}
                if version == "2":
                    row |= {c.removesuffix(ONLY_IN_FMI2): t for c, t in of_fmi2.items() if t}
                    row |= dict.fromkeys(ONLY_IN_FMI3, NOTHING)
                part = row.pop("name")
                found[part] = {c: t for c, t in row.items() if t not in ("", NOTHING)}
    return found


def differences(before: Interface, now: Interface) -> Iterator[tuple[str, str, str, str]]:
    """Yield name, column, text before and now of all that differs."""
    for name in dict.fromkeys([*before, *now]):
        if name not in before or name not in now:
            yield name, "", *("there" if name in them else "missing" for them in (before, now))
            continue
        for column in dict.fromkeys([*before[name], *now[name]]):
            texts = [them[name].get(column, "") for them in (before, now)]
            if texts[0] != texts[1]:
                yield name, column, *texts


def _rows(build: Path) -> Iterator[Row]:
    """Yield a row for each variable and each other part of each FMU."""
    for fmu in EVERY:
        of2, of3 = (of_fmu(build / place / f"{fmu}.fmu") for place in PLACES.values())
        for name in dict.fromkeys([*of3, *of2]):
            versions = " ".join(v for v, of in (("2", of2), ("3", of3)) if name in of)
            row = dict(of3.get(name, of2.get(name, {})))
            both = {*row, *of2[name]} - ONLY_IN_FMI3 if versions == "2 3" else ()
            for column in sorted(both):
                if (text := of2[name].get(column, NOTHING)) != row.get(column, NOTHING):
                    row[column + ONLY_IN_FMI2] = text
            yield {"fmu": fmu, "fmi": versions, "name": name, **row}


def main() -> None:
    """Write the table from the FMUs of a build."""
    rows = [*_rows(Path(sys.argv[1]))]
    columns = dict.fromkeys(column for row in rows for column in row)
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [*columns], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

"""Writes checksums of a release, and its bill of materials in CycloneDX."""

import argparse
import hashlib
import re
import sys
import tomllib
import uuid
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from cyclonedx.model import ExternalReference, ExternalReferenceType, HashAlgorithm, HashType, XsUri
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import DisjunctiveLicense
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.spdx import is_supported_id
from cyclonedx.validation.json import JsonStrictValidator
from packageurl import PackageURL
from program import atomic_write, license_texts, program

CHECKSUMS = "SHA256SUMS"
BILL = "sbom.cdx.json"


def part(text: str) -> Component:
    """Read a part of all files from NAME,VERSION,LICENSE,ADDRESS; the license is as in SPDX."""
    try:
        name, version, license_id, address = text.split(",")
    except ValueError:
        raise ValueError(f"{text}: not NAME,VERSION,LICENSE,ADDRESS") from None
    if not is_supported_id(license_id):
        raise ValueError(f"{text}: SPDX has no license {license_id}")
    return Component(
        type=ComponentType.LIBRARY,
        name=name,
        version=version,
        bom_ref=name,
        licenses=[DisjunctiveLicense(id=license_id)],
        external_references=[
            ExternalReference(type=ExternalReferenceType.WEBSITE, url=XsUri(address))
        ],
    )


def packages(project: Path, locks: Path) -> list[Component]:
    """What the wheel requires, with the versions that are locked: those it was tested with."""
    wanted = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
    lines = [*wanted["dependencies"], *chain(*wanted["optional-dependencies"].values())]
    names = {re.match(r"[\w.-]+", line)[0].lower() for line in lines}
    locked = {}
    for lock in sorted(locks.glob("*.txt")):
        found = re.findall(r"^([\w.-]+)==(\S+)", lock.read_text("utf-8"), re.MULTILINE)
        for name, version in found:
            locked[name.lower()] = version
    return [
        Component(
            type=ComponentType.LIBRARY,
            name=name,
            version=locked.get(name),
            bom_ref=f"package {name}",
            purl=PackageURL("pypi", name=name, version=locked.get(name)),
        )
        for name in sorted(names - {wanted["name"]})
    ]


def bill_of_materials(
    checksums: dict[str, str],
    version: str,
    license_id: str,
    parts: list[Component],
    required: Sequence[Component] = (),
) -> str:
    """Text in JSON of files by checksum, of parts in the FMUs, and of what the wheel requires."""
    bom = Bom(components=[*parts, *required])
    for name, checksum in checksums.items():
        component = Component(
            type=ComponentType.FILE,
            name=name,
            version=version,
            bom_ref=name,
            licenses=[DisjunctiveLicense(id=license_id)],
            hashes=[HashType(alg=HashAlgorithm.SHA_256, content=checksum)],
        )
        bom.components.add(component)
        bom.register_dependency(component, [*parts, *(required if name.endswith(".whl") else ())])
    # no date and no random number, so that two builds give the same bytes
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_OID, "".join(checksums.values()))
    bom.metadata.timestamp = None
    text = JsonV1Dot6(bom).output_as_string(indent=2)
    fault = JsonStrictValidator(JsonV1Dot6(bom).schema_version).validate_str(text)
    if fault is not None:
        raise ValueError(f"the bill of materials is not valid: {fault}")
    return text + "\n"


@program(ValueError)
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    text = "files of the release, below the output"
    parser.add_argument("files", type=Path, nargs="+", help=text)
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--version", required=True, help="version of the project")
    parser.add_argument("--license", type=Path, required=True, help="LICENSE of the project")
    parser.add_argument(
        "--part", action="append", default=[], metavar="NAME,VERSION,LICENSE,ADDRESS",
        help="what is compiled into all of them",
    )  # fmt: skip
    parser.add_argument("--project", type=Path, help="pyproject.toml, if there is a wheel")
    parser.add_argument("--requirements", type=Path, help="folder of the lock files, for the same")
    arguments = parser.parse_args()
    folder = arguments.output
    checksums = {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(arguments.files)
    }
    license_id = license_texts(arguments.license)["license"]
    parts = [part(text) for text in arguments.part]
    required = packages(arguments.project, arguments.requirements) if arguments.project else []
    texts = {
        CHECKSUMS: "".join(f"{text}  {name}\n" for name, text in checksums.items()),
        BILL: bill_of_materials(checksums, arguments.version, license_id, parts, required),
    }
    for name, text in texts.items():
        with atomic_write(folder / name) as temporary:
            temporary.write_bytes(text.encode())


if __name__ == "__main__":
    sys.exit(main())

"""Joins libraries for macOS to one that has the code of several processors, as lipo does."""

from __future__ import annotations

import struct
from collections.abc import Sequence

LIBRARY = b"\xcf\xfa\xed\xfe"  # magic of a file for one processor with 64 bits
UNIVERSAL = 0xCAFEBABE  # of one for several
# by the first number of the processor: pages have 2**n bytes
PAGES = {0x01000007: 12, 0x0100000C: 14}  # x86_64, Arm


def universal(libraries: Sequence[bytes]) -> bytes:
    """One library of several; ValueError if one is not for macOS, or two are for one processor."""
    parts = {}
    for library in libraries:
        processor, kind = struct.unpack_from("<II", library.ljust(12, b"\0"), 4)
        if not library.startswith(LIBRARY) or processor not in PAGES or processor in parts:
            raise ValueError("only libraries for macOS, each for another processor, can be joined")
        parts[processor] = (kind, library)
    head = struct.pack(">II", UNIVERSAL, len(parts))
    end = len(head) + 20 * len(parts)
    body = b""
    for processor, (kind, library) in sorted(parts.items()):
        page = PAGES[processor]
        gap = -(end + len(body)) % 2**page
        body += bytes(gap) + library
        head += struct.pack(
            ">IIIII", processor, kind, end + len(body) - len(library), len(library), page
        )
    return head + body

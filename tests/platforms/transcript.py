"""Reads transcripts of platform_host."""

import struct
from dataclasses import dataclass, field

from tests.platforms.scripts import Script


@dataclass
class Answer:
    """What an FMU answered to one line of a script."""

    call: str
    status: str
    words: list[str]
    log: list[list[str]] = field(default_factory=list)  # instance, status, category, text

    @property
    def reals(self) -> list[float]:
        """Of all words that are the bits of a double."""
        words = (word for word in self.words if len(word) == 16)
        return [struct.unpack(">d", bytes.fromhex(word))[0] for word in words]


def read(script: Script, transcript: bytes) -> list[Answer]:
    """The answer to every line of the script."""
    answers: list[Answer] = []
    log: list[list[str]] = []
    for line in transcript.decode().splitlines():
        number, name, *words = line.split(" ")
        if name == "log":
            log.append([*words[:3], " ".join(words[3:])])
        else:
            call = script.lines[int(number) - 1]
            assert len(answers) == int(number) - 1 and name in call
            answers.append(Answer(call, words[0], words[1:], log))
            log = []
    assert len(answers) == len(script.lines)
    return answers


def first_difference(script: Script, expected: bytes, actual: bytes) -> str | None:
    """A text about the first line that differs: the call, and what differs in its answer; None if
    all bytes are equal."""
    if expected == actual:
        return None
    lines = list(zip(expected.splitlines(), actual.splitlines(), strict=False))
    different = [(one, other) for one, other in lines if one != other]
    if not different:
        return f"one transcript ends before the other: {len(expected)} and {len(actual)} bytes"
    first = [line.decode().split(" ") for line in different[0]]
    call = script.lines[int(first[0][0]) - 1]
    words = [
        f"word {i}: {one} and {other}"
        for i, (one, other) in enumerate(zip(*first, strict=False))
        if one != other
    ]
    return f"{len(different)} of {len(lines)} lines; the first: {call}\n" + "\n".join(words)

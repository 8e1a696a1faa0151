"""Reads transcripts of platform_host."""

import struct
from dataclasses import dataclass, field


@dataclass
class Answer:
    """What an FMU answered to a call."""

    call: str
    status: str
    words: list[str]
    log: list[list[str]] = field(default_factory=list)  # instance, status, category, text

    @property
    def reals(self) -> list[float]:
        """Of all words that are the bits of a double."""
        words = (word for word in self.words if len(word) == 16)
        return [struct.unpack(">d", bytes.fromhex(word))[0] for word in words]


def read(transcript: bytes) -> list[Answer]:
    """The answers to all calls."""
    answers: list[Answer] = []
    log: list[list[str]] = []
    for line in transcript.decode().strip().splitlines():
        _, name, *words = line.split(" ")
        if name == "log":
            log.append([*words[:3], " ".join(words[3:])])
        else:
            answers.append(Answer(name, words[0], words[1:], log))
            log = []
    return answers


def first_difference(expected: bytes, actual: bytes) -> str | None:
    """A text about the first line that differs: the number and the name of the call, and what
    differs in its answer; None if all bytes are equal."""
    if expected == actual:
        return None
    lines = list(zip(expected.splitlines(), actual.splitlines(), strict=False))
    different = [(one, other) for one, other in lines if one != other]
    if not different:
        return f"one transcript ends before the other: {len(expected)} and {len(actual)} bytes"
    first = [line.decode().split(" ") for line in different[0]]
    words = [
        f"word {i}: {one} and {other}"
        for i, (one, other) in enumerate(zip(*first, strict=False))
        if one != other
    ]
    call = " ".join(first[0][:2])
    return f"{len(different)} of {len(lines)} lines; the first: {call}\n" + "\n".join(words)

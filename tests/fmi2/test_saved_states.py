"""Saved states through fmpy: which are refused, and how much memory they take."""

import ctypes
from collections.abc import Callable
from ctypes import byref

import pytest
from fmpy import fmi2

from tests.fmi2.rollback_sequences import START
from tests.support.instances import (
    ERROR,
    Instance,
    LoadedFmu,
    hashed,
    restore,
    serialized,
    status_of,
)


@pytest.mark.parametrize(
    ("damaged", "text"),
    [
        (lambda content: content[:100] + b"?" + content[101:], "checksum"),
        (lambda content: content[:100], "length"),
        (lambda content: hashed(b"X" + content[1:]), "not a saved state"),
    ],
    ids=["a byte", "cut", "magic"],
)
def test_refusals_say_what_is_wrong(
    loaded: LoadedFmu, damaged: Callable[[bytes], bytes], text: str
) -> None:
    """What else is refused is in test_fmi2_damaged_states.c."""
    with Instance(loaded) as instance:
        content = serialized(instance.initialize(**START))
        assert status_of(restore, instance, damaged(content)) == ERROR
        assert text in instance.messages[-1].text


# ---- Memory


def allocated() -> int:
    """Bytes that malloc has given away in this process."""

    class Mallinfo2(ctypes.Structure):
        _fields_ = [
            (name, ctypes.c_size_t)
            for name in (
                *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
                *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
            )
        ]

    mallinfo2 = ctypes.CDLL(None).mallinfo2
    mallinfo2.restype = Mallinfo2
    found = mallinfo2()
    return found.uordblks + found.hblkhd


def free_each(instance: Instance) -> None:
    for _ in range(2000):
        state = instance.fmi.getFMUstate()
        instance.fmi.freeFMUstate(state)


def use_one_again(instance: Instance) -> None:
    state = fmi2.fmi2FMUstate()
    for _ in range(2000):
        instance.fmi.fmi2GetFMUstate(instance.fmi.component, byref(state))


def serialize_all(instance: Instance) -> None:
    for _ in range(500):
        restore(instance, serialized(instance))


def free_none(instance: Instance) -> None:
    for _ in range(2000):
        instance.fmi.getFMUstate()


@pytest.mark.parametrize("use", [free_each, use_one_again, serialize_all])
def test_states_that_are_freed_cost_no_memory(
    loaded: LoadedFmu, use: Callable[[Instance], None]
) -> None:
    with Instance(loaded) as instance:
        instance.initialize(**START)
        use(instance)
        before = allocated()
        use(instance)
        assert allocated() - before < 50_000  # 2000 states are 2 MB at least


def test_states_that_nobody_frees_are_freed_with_the_instance(loaded: LoadedFmu) -> None:
    def once() -> int:
        with Instance(loaded) as instance:
            instance.initialize(**START)
            before = allocated()
            free_none(instance)
            return allocated() - before

    once()
    before = allocated()
    assert once() > 1_000_000
    assert allocated() - before < 50_000

"""Saved states through fmpy: which are refused, and how much memory they take."""

import ctypes
import random
from collections.abc import Callable
from ctypes import byref

import pytest
from fmpy import fmi2

from tests.fmi2.rollback_sequences import START, do, run, sequence, times
from tests.support.instances import (
    ERROR,
    Instance,
    LoadedFmu,
    hashed,
    restore,
    serialized,
    status_of,
)

# ---- What is refused


def with_guid(content: bytes, guid: str, loaded: LoadedFmu) -> bytes:
    """`content` as a unit with another GUID would have written it."""
    own, new = loaded.description.guid.encode(), guid.encode()
    begin = content.index(own)
    end = begin + len(own)
    length = len(content) - len(own) + len(new)
    head = content[:12] + length.to_bytes(4, "little") + len(new).to_bytes(4, "little")
    return hashed(head + new + content[end:])


def damages(content: bytes, loaded: LoadedFmu, chance: random.Random) -> dict[str, bytes]:
    """States that must be refused, by what is wrong."""
    found = {}
    for i in range(len(content)):
        changed = bytearray(content)
        changed[i] ^= 1 << chance.randrange(8)
        found[f"byte {i} changed"] = bytes(changed)
    found |= {f"cut to {i} bytes": content[:i] for i in range(1, len(content))}
    guid = loaded.description.guid
    found["longer"] = content + b"\0"
    found["longer, with a checksum"] = hashed(content + b"\0")
    found["zeros"] = bytes(len(content))
    found["random"] = chance.randbytes(len(content))
    found["older"] = hashed(content[:8] + (1).to_bytes(4, "little") + content[12:])
    found["newer"] = hashed(content[:8] + (3).to_bytes(4, "little") + content[12:])
    found["much newer"] = hashed(content[:8] + b"\xff\xff\xff\xff" + content[12:])
    found["other magic"] = hashed(b"X" + content[1:])
    found["other GUID"] = with_guid(content, guid[:-2] + "0}" + guid[-1:], loaded)[: len(content)]
    for name, text in (("changed", guid[::-1]), ("shorter", guid[:-1]), ("longer", guid + "x")):
        found[f"GUID {name}"] = with_guid(content, text, loaded)
    return found


def test_the_format_is_the_one_that_is_damaged_here(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        content = serialized(instance.initialize(**START))
    assert content[:12] == b"COSIMSTA\2\0\0\0" and hashed(content) == content
    assert with_guid(content, loaded.description.guid, loaded) == content


def test_damaged_foreign_and_newer_states_are_refused(loaded: LoadedFmu) -> None:
    """With a message and fmi2Error; a state saved before brings the instance back unharmed."""
    chance = random.Random(0)
    moves = sequence("held", 40, chance)
    expected, at = run(loaded, moves), times(moves)
    with Instance(loaded) as instance:
        instance.initialize(**START)
        for t, move in zip(at, moves[:20], strict=False):
            do(instance, t, move)
        content, state = serialized(instance), instance.fmi.getFMUstate()
        own = instance.everything()
        for what, wrong in damages(content, loaded, chance).items():
            handle = fmi2.fmi2FMUstate()
            count = len(instance.messages)
            status = status_of(
                instance.fmi.fmi2DeSerializeFMUstate,
                *(instance.fmi.component, wrong, len(wrong), byref(handle)),
            )
            assert status == ERROR, what
            assert handle.value is None, what
            assert len(instance.messages) == count + 1, what
            assert instance.messages[-1].status == ERROR
        assert instance.everything() == own  # as it was
        assert status_of(instance.fmi.doStep, at[20], moves[20].length) == ERROR  # in error

        instance.fmi.setFMUstate(state)
        for i in range(20, 30):
            assert do(instance, at[i], moves[i]) == expected[i]
        assert status_of(restore, instance, content[:-1]) == ERROR
        instance.fmi.reset()
        instance.initialize(**START)
        for i in range(10):
            assert do(instance, at[i], moves[i]) == expected[i]


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("byte 100 changed", "checksum"),
        ("cut to 100 bytes", "length"),
        ("older", "version"),
        ("newer", "version"),
        ("GUID changed", "GUID"),
        ("other magic", "not a saved state"),
    ],
)
def test_refusals_say_what_is_wrong(loaded: LoadedFmu, what: str, text: str) -> None:
    with Instance(loaded) as instance:
        content = serialized(instance.initialize(**START))
        assert (
            status_of(restore, instance, damages(content, loaded, random.Random(1))[what]) == ERROR
        )
        assert text in instance.messages[-1].text


def test_a_buffer_that_is_too_small_is_refused(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        state = instance.initialize().fmi.getFMUstate()
        size = ctypes.c_size_t()
        instance.fmi.fmi2SerializedFMUstateSize(instance.fmi.component, state, byref(size))
        buffer = ctypes.create_string_buffer(b"\x55" * size.value, size.value)
        arguments = (instance.fmi.component, state, buffer, size.value - 1)
        assert status_of(instance.fmi.fmi2SerializeFMUstate, *arguments) == ERROR
        assert buffer.raw == b"\x55" * size.value


def test_states_of_others_are_refused(loaded: LoadedFmu) -> None:
    """Of another instance, and of one for Model Exchange; freed ones too."""
    with (
        Instance(loaded) as first,
        Instance(loaded) as second,
        Instance(loaded, fmi2.FMU2Model) as model,
    ):
        first.initialize(**START)
        state, content = first.fmi.getFMUstate(), serialized(first)
        assert status_of(second.fmi.setFMUstate, state) == ERROR
        second.fmi.reset()
        restore(second, content)
        assert second.everything() == first.everything()
        assert status_of(restore, model, content) == ERROR
        assert model.messages[-1].status == ERROR
        model.fmi.reset()
        model.initialize(**START)
        assert status_of(restore, first, serialized(model)) == ERROR

        first.fmi.reset()
        gone = ctypes.c_void_p(state.value)
        first.fmi.freeFMUstate(state)
        assert state.value is None
        first.fmi.freeFMUstate(state)  # once more: nothing to do
        assert status_of(first.fmi.setFMUstate, gone) == ERROR


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

"""Rollback through fmpy: saved, serialized and restored states give the same results, bit for bit.

Run as a program (fmu folder, file of a serialized state, file of a sequence), it is another
process that restores a state and goes on from there.
"""

import ctypes
import json
import random
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import ROOT
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from instances import ERROR, INPUTS, STATES, Instance, Unit, status_of

from cosim import convergence

SEQUENCES = 100
START = {"q1": -1.43, "q2": 0.58, "dq1": 1.97, "dq2": 0.12}
WHIRL = {"g": 0.0, "q2": 0.1, "dq1": 20.0, "f2": -60.0, "relative_tolerance": 1e-12}
KINDS = ("undisturbed", "held", "changing", "moving", "mixed")


@pytest.fixture(scope="module")
def unit(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Unit:
    return Unit(fmu, tmp_path_factory.mktemp("unit"))


# ---- Sequences of calls ------------------------------------------------------------------------


@dataclass(frozen=True)
class Move:
    """One communication step and what is set before it."""

    length: float  # s
    values: dict[str, float]  # inputs and tunable parameters
    derivatives: dict[str, list[float]]  # of inputs, from order 1 on


def sequence(kind: str, length: int, chance: random.Random) -> list[Move]:
    """Random steps.

    undisturbed: nothing changes, the integrator goes on with its history; held: inputs change now
    and then; changing: at every step; moving: with derivatives at every step; mixed: all this, and
    parameters too.
    """
    moves = []
    for _ in range(length):
        values: dict[str, float] = {}
        derivatives: dict[str, list[float]] = {}
        mode = chance.choice(KINDS[:-1]) if kind == "mixed" else kind
        if mode in ("changing", "moving") or (mode == "held" and chance.random() < 0.05):
            values = {"tau1": chance.gauss(0, 2), "f2": chance.gauss(-9, 2)}
            for name in chance.sample(INPUTS, chance.choice((0, 0, 1))):
                del values[name]  # set one input only
        if mode == "moving":
            for name in chance.sample(INPUTS, chance.choice((1, 2))):
                derivatives[name] = [chance.gauss(0, 5) for _ in range(chance.randint(1, 3))]
        if kind == "mixed" and chance.random() < 0.1:
            values["m2"] = chance.uniform(0.5, 2)
            values["g"] = chance.uniform(0, 10)
        moves.append(Move(chance.choice((1e-3, 1e-2, 1 / 60, 0.03)), values, derivatives))
    return moves


def times(moves: list[Move]) -> list[float]:
    """Communication points of a master that adds up its steps."""
    found = [0.0]
    for move in moves:
        found.append(found[-1] + move.length)
    return found


def do(instance: Instance, t: float, move: Move) -> bytes:
    """One step; all values before it, with the new inputs, and after it."""
    instance.set(**move.values)
    instance.set_input_derivatives(**move.derivatives)
    before = instance.everything()
    instance.step(t, move.length)
    return before + instance.everything()


def run(unit: Unit, moves: list[Move], start: dict[str, float] = START) -> list[bytes]:
    """Bytes after every step of a run without any snapshot."""
    with Instance(unit) as instance:
        instance.initialize(**start)
        return [do(instance, t, move) for t, move in zip(times(moves), moves, strict=False)]


def serialized(instance: Instance) -> bytes:
    """The state as bytes, with the copy in memory freed."""
    state = instance.fmi.getFMUstate()
    content = instance.fmi.serializeFMUstate(state)
    instance.fmi.freeFMUstate(state)
    return content


def restore(instance: Instance, content: bytes) -> None:
    state = instance.fmi.deSerializeFMUstate(content)
    instance.fmi.setFMUstate(state)
    instance.fmi.freeFMUstate(state)


def other(unit: Unit, chance: random.Random) -> Instance:
    """Another instance in some state or other, with values of its own."""
    instance = Instance(unit)
    state = chance.randrange(4)
    if state > 0:
        instance.initialize(3.0, tolerance=1e-5, q1=0.7, m1=3.0)
    if state > 1:
        instance.set(tau1=1.0)
        instance.step(3.0, 0.1)
    if state > 2:
        assert status_of(instance.fmi.getReal, [9999]) == ERROR
    instance.messages.clear()
    return instance


# ---- Same bytes --------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(SEQUENCES))
def test_random_rollback(unit: Unit, number: int) -> None:
    """Snapshots and jumps back at random, within an instance and from one to another."""
    chance = random.Random(number)
    kind = KINDS[number % len(KINDS)]
    # now and then the integrator needs more steps than it keeps as its history
    is_long = number % 20 == 0
    moves = sequence(kind, 400 if is_long else chance.randint(5, 40), chance)
    at = times(moves)
    stop = {"stop": at[-1]} if chance.random() < 0.5 else {}
    start = (WHIRL if is_long else START) | stop
    expected = run(unit, moves, start)
    instance = Instance(unit)
    saved: list[tuple[int, object]] = []
    packed: list[tuple[int, bytes]] = []
    try:
        instance.initialize(**start)
        position, left = 0, 3 * len(moves) + 20
        while position < len(moves):
            left -= 1
            action = chance.random() if left > 0 else 1.0
            if action < 0.2:
                saved.append((position, instance.fmi.getFMUstate()))
            elif action < 0.3:
                packed.append((position, serialized(instance)))
            elif action < 0.4 and saved:
                position, state = chance.choice(saved)
                instance.fmi.setFMUstate(state)
            elif action < 0.45 and packed:
                position, content = chance.choice(packed)
                if chance.random() < 0.5:
                    instance.fmi.freeInstance()  # with all its snapshots
                    saved.clear()
                    instance = other(unit, chance)
                restore(instance, content)
            elif action < 0.5 and saved:
                state = saved.pop(chance.randrange(len(saved)))[1]
                instance.fmi.freeFMUstate(state)
            else:
                assert do(instance, at[position], moves[position]) == expected[position]
                position += 1
        assert not instance.messages
        assert not is_long or instance.count("solver_restarts") > 2
    finally:
        instance.fmi.freeInstance()


@pytest.mark.parametrize("kind", KINDS)
def test_snapshots_leave_no_trace(unit: Unit, kind: str) -> None:
    """A state saved at every step, from the initialization on: the same bytes as without."""
    moves = sequence(kind, 300, random.Random(kind))
    with Instance(unit) as instance:
        instance.fmi.getFMUstate()
        instance.initialize(**START)
        for t, move, expected in zip(times(moves), moves, run(unit, moves), strict=False):
            state = instance.fmi.getFMUstate()
            serialized(instance)
            assert do(instance, t, move) == expected
            instance.fmi.freeFMUstate(state)


@pytest.mark.parametrize("kind", KINDS)
def test_rollback_at_every_step_leaves_no_trace(unit: Unit, kind: str) -> None:
    """Each step is tried in another way, undone and made: the same bytes as without."""
    chance = random.Random(kind)
    moves, tried = sequence(kind, 300, chance), sequence("mixed", 300, chance)
    with Instance(unit) as instance:
        instance.initialize(**START)
        state = instance.fmi.getFMUstate()
        for t, move, trial, expected in zip(
            times(moves), moves, tried, run(unit, moves), strict=False
        ):
            instance.fmi.fmi2GetFMUstate(instance.fmi.component, byref(state))  # same memory
            do(instance, t, trial)
            instance.fmi.setFMUstate(state)
            assert do(instance, t, move) == expected


@pytest.mark.parametrize("kind", KINDS)
def test_another_process_goes_on_the_same(unit: Unit, tmp_path: Path, kind: str) -> None:
    moves = sequence(kind, 60, random.Random(kind))
    at, cut = times(moves), 30
    with Instance(unit) as instance:
        instance.initialize(**START)
        for t, move in zip(at, moves[:cut], strict=False):
            do(instance, t, move)
        (tmp_path / "state").write_bytes(serialized(instance))
        rest = [do(instance, t, m).hex() for t, m in zip(at[cut:], moves[cut:], strict=False)]
        final = [x.hex() for x in instance.get(*STATES)]
    plan = [[t, m.length, m.values, m.derivatives] for t, m in zip(at, moves, strict=False)]
    (tmp_path / "moves").write_text(json.dumps(plan[cut:]))
    arguments = (unit.folder, tmp_path / "state", tmp_path / "moves")
    command = [sys.executable, __file__, *map(str, arguments)]
    output = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert output.stdout.split() == [*rest, *final]


def main(folder: str, state: str, moves: str) -> None:
    """Restore and go on; print the bytes after each step and the final state as hexadecimals."""
    with Instance(Unit(Path(folder), Path(folder))) as instance:
        restore(instance, Path(state).read_bytes())
        for t, *move in json.loads(Path(moves).read_text()):
            print(do(instance, t, Move(*move)).hex())
        print(*(x.hex() for x in instance.get(*STATES)))


def test_states_of_the_initialization_are_restored(unit: Unit) -> None:
    """Before, in and after initialization, and after the end."""
    with Instance(unit) as instance:
        states = [instance.fmi.getFMUstate()]
        instance.fmi.setupExperiment(startTime=2.0, stopTime=3.0, tolerance=1e-6)
        instance.set(q1=1.0)
        states.append(instance.fmi.getFMUstate())
        instance.fmi.enterInitializationMode()
        states.append(instance.fmi.getFMUstate())
        instance.fmi.exitInitializationMode()
        instance.step(2.0, 1.0)
        expected = instance.everything()
        instance.fmi.terminate()
        states.append(instance.fmi.getFMUstate())
        instance.fmi.reset()

        instance.fmi.setFMUstate(states[3])
        assert instance.everything() == expected
        assert status_of(instance.fmi.doStep, 3.0, 1.0) == ERROR
        instance.fmi.setFMUstate(states[2])
        instance.fmi.exitInitializationMode()
        instance.step(2.0, 1.0)
        assert instance.everything() == expected
        instance.fmi.setFMUstate(states[1])
        instance.fmi.enterInitializationMode()
        instance.fmi.exitInitializationMode()
        instance.step(2.0, 1.0)
        assert instance.everything() == expected
        instance.fmi.setFMUstate(states[0])
        instance.initialize(2.0, 3.0, 1e-6, q1=1.0)
        instance.step(2.0, 1.0)
        assert instance.everything() == expected


# ---- What is refused ---------------------------------------------------------------------------


def hashed(content: bytes) -> bytes:
    """`content` with the checksum that belongs to it: FNV-1a of all before, 64 bit."""
    value = 0xCBF29CE484222325
    for byte in content[:-8]:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return content[:-8] + value.to_bytes(8, "little")


def with_guid(content: bytes, guid: str, unit: Unit) -> bytes:
    """`content` as a unit with another GUID would have written it."""
    own, new = unit.description.guid.encode(), guid.encode()
    begin = content.index(own)
    end = begin + len(own)
    length = len(content) - len(own) + len(new)
    head = content[:12] + length.to_bytes(4, "little") + len(new).to_bytes(4, "little")
    return hashed(head + new + content[end:])


def damages(content: bytes, unit: Unit, chance: random.Random) -> dict[str, bytes]:
    """States that must be refused, by what is wrong."""
    found = {}
    for i in range(len(content)):
        changed = bytearray(content)
        changed[i] ^= 1 << chance.randrange(8)
        found[f"byte {i} changed"] = bytes(changed)
    found |= {f"cut to {i} bytes": content[:i] for i in range(1, len(content))}
    guid = unit.description.guid
    found["longer"] = content + b"\0"
    found["longer, with a checksum"] = hashed(content + b"\0")
    found["zeros"] = bytes(len(content))
    found["random"] = chance.randbytes(len(content))
    found["newer"] = hashed(content[:8] + (2).to_bytes(4, "little") + content[12:])
    found["much newer"] = hashed(content[:8] + b"\xff\xff\xff\xff" + content[12:])
    found["other magic"] = hashed(b"X" + content[1:])
    found["other GUID"] = with_guid(content, guid[:-2] + "0}" + guid[-1:], unit)[: len(content)]
    for name, text in (("changed", guid[::-1]), ("shorter", guid[:-1]), ("longer", guid + "x")):
        found[f"GUID {name}"] = with_guid(content, text, unit)
    return found


def test_the_format_is_the_one_that_is_damaged_here(unit: Unit) -> None:
    with Instance(unit) as instance:
        content = serialized(instance.initialize(**START))
    assert content[:12] == b"COSIMSTA\1\0\0\0" and hashed(content) == content
    assert with_guid(content, unit.description.guid, unit) == content


def test_damaged_foreign_and_newer_states_are_refused(unit: Unit) -> None:
    """With a message and fmi2Error; a state saved before brings the instance back unharmed."""
    chance = random.Random(0)
    moves = sequence("held", 40, chance)
    expected, at = run(unit, moves), times(moves)
    with Instance(unit) as instance:
        instance.initialize(**START)
        for t, move in zip(at, moves[:20], strict=False):
            do(instance, t, move)
        content, state = serialized(instance), instance.fmi.getFMUstate()
        own = instance.everything()
        for what, wrong in damages(content, unit, chance).items():
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
        ("newer", "version"),
        ("GUID changed", "GUID"),
        ("other magic", "no saved state"),
    ],
)
def test_refusals_say_what_is_wrong(unit: Unit, what: str, text: str) -> None:
    with Instance(unit) as instance:
        content = serialized(instance.initialize(**START))
        assert status_of(restore, instance, damages(content, unit, random.Random(1))[what]) == ERROR
        assert text in instance.messages[-1].text


def test_a_buffer_that_is_too_small_is_refused(unit: Unit) -> None:
    with Instance(unit) as instance:
        state = instance.initialize().fmi.getFMUstate()
        size = ctypes.c_size_t()
        instance.fmi.fmi2SerializedFMUstateSize(instance.fmi.component, state, byref(size))
        buffer = ctypes.create_string_buffer(b"\x55" * size.value, size.value)
        arguments = (instance.fmi.component, state, buffer, size.value - 1)
        assert status_of(instance.fmi.fmi2SerializeFMUstate, *arguments) == ERROR
        assert buffer.raw == b"\x55" * size.value


def test_states_of_others_are_refused(unit: Unit) -> None:
    """Of another instance, and of one for Model Exchange; freed ones too."""
    with Instance(unit) as first, Instance(unit) as second, Instance(unit, fmi2.FMU2Model) as model:
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


# ---- Memory ------------------------------------------------------------------------------------


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
def test_states_that_are_freed_cost_no_memory(unit: Unit, use: Callable[[Instance], None]) -> None:
    with Instance(unit) as instance:
        instance.initialize(**START)
        use(instance)
        before = allocated()
        use(instance)
        assert allocated() - before < 50_000  # 2000 states are 2 MB at least


def test_states_that_nobody_frees_are_freed_with_the_instance(unit: Unit) -> None:
    def once() -> int:
        with Instance(unit) as instance:
            instance.initialize(**START)
            before = allocated()
            free_none(instance)
            return allocated() - before

    once()
    before = allocated()
    assert once() > 1_000_000
    assert allocated() - before < 50_000


# ---- A master that needs it --------------------------------------------------------------------


def test_master_with_step_doubling(unit: Unit) -> None:
    """A step, undone, and two halves: their difference controls the step, errors go back."""
    problem = convergence.load(ROOT / "models/rp_manipulator/convergence/smooth_inputs.toml")
    stop, bound = problem.scenario.stop, 1e-5

    def tell(instance: Instance, t: float) -> None:
        values = {name: sines.derivative(t, 0).item() for name, sines in problem.inputs.items()}
        instance.set(**values)
        slopes = {name: [s.derivative(t, 1).item()] for name, s in problem.inputs.items()}
        instance.set_input_derivatives(**slopes)

    accepted: list[tuple[float, float]] = []
    refused = 0
    with Instance(unit) as instance:
        instance.initialize(0.0, stop, 1e-10, **problem.scenario.initial)
        begin = instance.fmi.getFMUstate()
        t, h = 0.0, 0.5
        while t < stop:
            h = min(h, stop - t)
            instance.fmi.fmi2GetFMUstate(instance.fmi.component, byref(begin))
            tell(instance, t)
            instance.step(t, h)
            coarse = instance.get(*STATES)
            instance.fmi.setFMUstate(begin)
            tell(instance, t)
            middle = instance.step(t, h / 2)
            tell(instance, middle)
            instance.step(middle, t + h - middle)
            fine = instance.get(*STATES)
            error = max(abs(a - b) for a, b in zip(coarse, fine, strict=True))
            if error > bound:
                instance.fmi.setFMUstate(begin)
                refused += 1
                h /= 2
                continue
            accepted += [(t, h / 2), (middle, t + h - middle)]
            t += h
            if error < bound / 10:
                h *= 2
        final, everything = dict(zip(STATES, fine, strict=True)), instance.everything()
    assert refused > 5 and len({h for _, h in accepted}) > 3
    assert problem.error(final) < 1e-2  # inputs are linear in a step

    with Instance(unit) as instance:  # the same steps, none of them undone
        instance.initialize(0.0, stop, 1e-10, **problem.scenario.initial)
        for t, h in accepted:
            tell(instance, t)
            instance.step(t, h)
        assert instance.everything() == everything


def test_a_failed_step_can_be_undone(unit: Unit) -> None:
    """A step that the integrator cannot finish is fmi2Discard; the state before it is as good."""
    with Instance(unit) as instance:
        instance.fmi.setInteger([unit.references["max_internal_steps"]], [50])
        instance.initialize(**START)
        instance.step(0.0, 0.01)
        state, own = instance.fmi.getFMUstate(), instance.everything()
        with pytest.raises(FMICallException) as caught:
            instance.step(0.01, 100.0)
        assert caught.value.status == 2
        assert 0.01 <= instance.fmi.getRealStatus(fmi2.fmi2LastSuccessfulTime) < 100
        instance.fmi.setFMUstate(state)
        assert instance.everything() == own
        instance.step(0.01, 0.01)
        after = instance.everything()
    with Instance(unit) as instance:
        instance.fmi.setInteger([unit.references["max_internal_steps"]], [50])
        instance.initialize(**START)
        instance.step(instance.step(0.0, 0.01), 0.01)
        assert instance.everything() == after


if __name__ == "__main__":
    main(*sys.argv[1:])

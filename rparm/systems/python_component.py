"""Components in Python: a class, or a plain function, that is stepped like an FMU.

A class has the attributes `inputs` and `outputs`, lists of names, and `step(self, t, h, inputs)`. A
step gets the inputs at t; the outputs that it returns hold from t + h on. Until then they have the
values of the attribute `start`, else 0. `types` says which inputs and outputs are bool or int, not
float, `units` gives units. Further attributes are parameters. With `save()` and `restore(state)` a
master can go back. The inputs and outputs of a function `step(t, h, inputs)` are those of its
connections. Each instance runs the file again, so no run sees another's state.
"""

import copy
import math
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from ctypes import CFUNCTYPE, Array, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import InitVar, dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, Self, cast

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import CodeError, UserError, did_you_mean, one_line, reason
from rparm.files import is_file, show
from rparm.fmi.fmi_instance import (
    ERROR,
    Call,
    InputPolynomials,
    Instance,
    Snapshot,
    no_call,
    view,
)
from rparm.fmi.model import INTEGER, Model, Value, Variable
from rparm.units import units_of

SUFFIX = ".py"
ANY = "Python"  # type of an attribute that is no number, truth value or text
OWN = ("inputs", "outputs", "start", "types", "units")  # attributes that are no parameters
TYPES = {float: "Real", bool: "Boolean", int: "Integer"}  # of inputs and outputs, as in FMUs
INSTANCE = 1  # handle of an instance in calls of C


def split(source: str) -> tuple[str, str]:
    """Split FILE.py:CLASS into file and name; the name is empty without one."""
    file, colon, name = source.rpartition(":")
    return (file, name) if colon and file.lower().endswith(SUFFIX) else (source, "")


def is_python(source: str) -> bool:
    return split(source)[0].lower().endswith(SUFFIX)


class Attribute(Variable):
    """A variable of a component; an attribute of type `ANY` takes what a file says."""

    def checked(self, given: Any) -> Value:
        return given if self.type == ANY else super().checked(given)


# ---- The code ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class PythonComponent(AbstractContextManager["PythonComponent"]):
    """A component of a file, to instantiate like an FMU; it can be pickled.

    UserError if the file has no component of this name; CodeError if its code fails.
    """

    path: Path  # for messages, too
    text: str  # of the file
    name: str  # of the class or function; empty: the only one
    connected: tuple[tuple[str, ...], tuple[str, ...]]  # inputs and outputs, for a function

    @staticmethod
    def read(
        source: str, folder: Path, inputs: Sequence[str] = (), outputs: Sequence[str] = ()
    ) -> "PythonComponent":
        """Read FILE.py or FILE.py:CLASS in a folder; `inputs` and `outputs` are connected."""
        file, name = split(source)
        path = folder / file
        if not is_file(path):
            raise UserError(f"{path}: no such file")
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeError) as error:
            raise UserError(f"{path}: cannot be read: {reason(error)}") from error
        found = PythonComponent(path, text, name, (tuple(inputs), tuple(outputs)))
        _ = found.model  # runs the file: mistakes show here
        return found

    def __exit__(self, *_: object) -> None:
        pass

    def __reduce__(self) -> tuple:
        return PythonComponent, (self.path, self.text, self.name, self.connected)

    def instance(self, name: str, smooth_inputs: Sequence[str] = ()) -> "PythonInstance":
        return PythonInstance(self, name, smooth_inputs)

    @cached_property
    def model(self) -> Model:
        made = self.made()
        inputs = (*made.inputs, *made.switched_inputs)
        declared: list[tuple[str, str, str, Any]] = []
        for name in made.exchanged:
            of = made.kinds[name]
            end = ("input", of()) if name in inputs else ("output", None)
            declared.append((name, TYPES[of], *end))
        for name, value in made.attributes.items():
            of_attribute, start = _kind(value)
            declared.append((name, of_attribute, "parameter", start))
        variables = []
        for i, (name, kind, causality, start) in enumerate(declared):
            unit = made.units.get(name)
            if unit and kind != "Real":
                raise UserError(f"{self.path}: units: {name!r} is {kind}: only a number has a unit")
            initial = "exact" if causality == "parameter" else None
            limits = INTEGER if kind == "Integer" else (-math.inf, math.inf)
            variables.append(
                Attribute(name, i, kind, causality, initial, unit, start, *limits,
                          units=units_of(unit, {}))
            )  # fmt: skip
        return Model(
            name=self.name or self.path.stem,
            fmi_version="2.0",  # whose calls it takes
            variables={variable.name: variable for variable in variables},
            states=(),
            interpolates_inputs=False,
            gives_output_derivatives=False,
            saves_states=made.saves,
            gives_directional_derivatives=False,
            # a step gives outputs, from inputs at its beginning
            dependencies={v.name: () for v in variables if v.causality == "output"},
        )

    @property
    def target(self) -> str:
        """Name of its class or function in the file."""
        return str(self._target(self._module()).__name__)

    def made(self) -> "Made":
        """Run the file, and make an object of its class."""
        target = self._target(self._module())
        if isinstance(target, FunctionType):
            inputs, outputs = self.connected
            return Made(None, target, list(inputs), list(outputs), {}, {})
        with self.explained(f"{target.__name__}()"):
            made = target()
        inputs, outputs = (self._names(target, made, kind) for kind in OWN[:2])
        both = [name for name in inputs if name in outputs]
        if both:
            raise UserError(f"{self.path}: {both[0]!r} is both an input and an output")
        types, units = (self._declared(target, made, kind) for kind in OWN[3:])
        found = Made(made, made.step, inputs, outputs, types, units)
        for kind, given, known, what in (
            ("types", types, found.exchanged, "input or output"),
            ("units", units, [*found.exchanged, *found.attributes], "input, output or attribute"),
        ):
            for name in given:
                if name not in known:
                    wrong = f"{kind}: no {what} {name!r}{did_you_mean(str(name), known)}"
                    raise UserError(f"{self.path}: class {target.__name__!r}: {wrong}")
        return found

    @cached_property
    def _code(self) -> CodeType:
        try:
            return compile(self.text, str(self.path), "exec", dont_inherit=True)
        except (SyntaxError, ValueError) as error:
            line = getattr(error, "lineno", None)
            where = f"{self.path}, line {line}" if line else str(self.path)
            text = error.msg if isinstance(error, SyntaxError) else str(error)
            raise UserError(f"{where}: {one_line(text)}") from error

    def _module(self) -> ModuleType:
        module = ModuleType(f"rparm_component_{self.path.stem}")
        module.__file__ = str(self.path)
        sys.modules[module.__name__] = module  # as dataclasses and pickle look for it
        folder = str(self.path.absolute().parent)
        sys.path.insert(0, folder)  # of modules beside the file
        try:
            with self.explained("the file"):
                exec(self._code, module.__dict__)
        finally:
            sys.path.remove(folder)
        return module

    def _target(self, module: ModuleType) -> Any:
        own = {
            name: value
            for name, value in vars(module).items()
            if getattr(value, "__module__", None) == module.__name__ and not name.startswith("_")
        }
        steps = {n: x for n, x in own.items() if isinstance(x, type) and hasattr(x, "step")}
        steps |= {n: x for n, x in own.items() if isinstance(x, FunctionType) and n == "step"}
        if self.name:
            if self.name not in own:
                wrong = f"has no class {self.name!r}{did_you_mean(self.name, own)}"
                raise UserError(f"{self.path}: {wrong}")
            found = own[self.name]
            if isinstance(found, type) and not hasattr(found, "step"):
                raise UserError(f"{self.path}: class {self.name!r} has no step(self, t, h, inputs)")
            return found
        if not steps:
            expected = "a class with step(self, t, h, inputs), or a function step(t, h, inputs)"
            raise UserError(f"{self.path}: expected {expected}")
        if len(steps) > 1:
            known = " or ".join(f"{self.path.name}:{name}" for name in steps)
            raise UserError(f"{self.path}: has several components, write {known}")
        return next(iter(steps.values()))

    def _names(self, target: type, made: object, kind: str) -> list[str]:
        given = getattr(made, kind, None)
        is_list = isinstance(given, list | tuple) and all(isinstance(x, str) and x for x in given)
        if not is_list or len(set(given)) != len(given):
            got = "none" if given is None else show(given)
            where = f"{self.path}: class {target.__name__!r}: {kind}"
            raise UserError(f"{where}: expected a list of different names, got {got}")
        return list(given)

    def _declared(self, target: type, made: object, kind: str) -> dict[str, Any]:
        """Return `types` or `units` of inputs and outputs, by name."""
        given = getattr(made, kind, {})
        values = given.values() if isinstance(given, dict) else [None]
        are_types = kind == "types"
        if not all(x in TYPES if are_types else isinstance(x, str) and x for x in values):
            of = "bool, int or float" if are_types else "a text"
            where = f"{self.path}: class {target.__name__!r}: {kind}"
            raise UserError(f"{where}: expected a dict that gives a name {of}, got {show(given)}")
        return given

    @contextmanager
    def explained(self, when: str, name: str = "") -> Any:
        """Turn what the user's code raises into the user's error, with its line."""
        try:
            yield
        except UserError:
            raise
        except (Exception, SystemExit) as error:
            raise self.failure(error, when, name) from error

    def failure(self, error: BaseException, when: str, name: str = "") -> CodeError:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if frame.filename == str(self.path)]
        known = own or [frame for frame in frames[-1:] if frame.filename != __file__]
        where = f"{known[-1].filename}, line {known[-1].lineno}" if known else str(self.path)
        where = f"{name}: {where}" if name else where
        text = error.args[0] if isinstance(error, KeyError) and error.args else error
        said = f": {one_line(text)}" if str(text) else ""
        return CodeError(f"{where}: {type(error).__name__}{said} ({when})")


def _kind(value: object) -> tuple[str, Any]:
    """Return the type of an attribute, and its start value."""
    if isinstance(value, bool):
        return "Boolean", value
    if isinstance(value, int | float | np.integer | np.floating):
        return "Real", float(value)
    return ("String", value) if isinstance(value, str) else (ANY, show(value))


@dataclass
class Made:
    """An object of the user's class, or the user's function."""

    object: Any  # None of a function
    step: Callable[[float, float, dict[str, Any]], Any]
    inputs: list[str]  # Reals; at first all
    outputs: list[str]
    types: InitVar[Mapping[str, type]]
    units: Mapping[str, str]  # by name, where one is given
    switched_inputs: list[str] = field(init=False)  # Booleans and Integers
    switched_outputs: list[str] = field(init=False)
    kinds: dict[str, type] = field(init=False)  # of inputs and outputs, by name
    attributes: dict[str, Any] = field(init=False)  # that parameters may set, with their values

    def __post_init__(self, types: Mapping[str, type]) -> None:
        self.kinds = {name: types.get(name, float) for name in (*self.inputs, *self.outputs)}
        for kind in OWN[:2]:
            names = getattr(self, kind)
            setattr(self, kind, [name for name in names if self.kinds[name] is float])
            switched = [name for name in names if self.kinds[name] is not float]
            setattr(self, f"switched_{kind}", switched)
        found: dict[str, Any] = {}
        if self.object is not None:
            for kind in reversed(type(self.object).__mro__[:-1]):
                found |= vars(kind)
            found |= getattr(self.object, "__dict__", {})
        kept = {
            name: value
            for name, value in found.items()
            if not (name.startswith("_") or name in OWN or name in self.kinds)
            and not (callable(value) or hasattr(value, "__get__"))
        }
        self.attributes = kept

    @property
    def exchanged(self) -> list[str]:
        """Inputs and outputs, Reals first; value references are their places."""
        return [*self.inputs, *self.outputs, *self.switched_inputs, *self.switched_outputs]

    @property
    def saves(self) -> bool:
        """Whether a master can go back."""
        return all(callable(getattr(self.object, name, None)) for name in ("save", "restore"))

    @property
    def line(self) -> int:
        code = getattr(self.step, "__code__", None)
        return code.co_firstlineno if code else 1


class _Inputs(dict[str, Any]):
    def __missing__(self, name: str) -> Any:
        raise KeyError(f"no input {name!r}{did_you_mean(str(name), self)}")


# ---- The instance --------------------------------------------------------------------------------
class PythonInstance(Instance):
    """An object of a component, set, stepped and read as an instance of an FMU."""

    fmu: PythonComponent  # type: ignore[assignment]
    made: Made

    def __init__(self, fmu: PythonComponent, name: str, smooth_inputs: Sequence[str] = ()) -> None:
        super().__init__(cast(Any, fmu), name, smooth_inputs)
        self._raised: BaseException | None = None  # in a call of C

    def _load(self) -> "_Calls":
        return _Calls(self)

    def _instantiate(self) -> None:
        self.made = made = self.fmu.made()
        self._count = len(made.inputs)
        self._exchanged = [*made.inputs, *made.outputs]
        self._names = list(self.fmu.model.variables)
        self._given = {*made.outputs, *made.switched_outputs}  # by a step
        if self.memory is None:  # inputs, then outputs; it stays where it is
            self.memory = np.zeros(len(self._exchanged))
        self.memory[:] = 0.0
        # Booleans and Integers
        self.switches = {name: 0 for name in (*made.switched_inputs, *made.switched_outputs)}

    def __enter__(self) -> Self:
        self._instantiate()
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def reset(self) -> None:
        self._instantiate()

    def failure(self, error: FMICallException, when: str) -> UserError:
        if self._raised is None:
            return super().failure(error, when)
        raised, self._raised = self._raised, None
        if isinstance(raised, UserError):
            return raised
        raise raised

    # ---- Initialization --------------------------------------------------------------------------

    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> None:
        pass

    def enter_initialization(self) -> None:
        given = getattr(self.made.object, "start", {})
        if not isinstance(given, Mapping):
            raise self._wrong(f"start: expected a dict of outputs, got {show(given)}")
        for name in given:
            self._check_output(name, "start")
        for i, name in enumerate(self.made.outputs, self._count):
            self.memory[i] = self._number(name, given.get(name, 0.0), "start")
        for name in self.made.switched_outputs:
            self.switches[name] = self._switch(name, given.get(name, 0), "start")

    def exit_initialization(self) -> None:
        self._initialized = True

    # ---- Values ----------------------------------------------------------------------------------

    def set(self, name: str, value: Value) -> None:
        if name in self._exchanged:
            self.memory[self._exchanged.index(name)] = value
            return
        if name in self.switches:
            self.switches[name] = int(value)
            return
        if isinstance(value, list) and isinstance(self.made.attributes[name], np.ndarray):
            try:
                value = cast(Any, np.array(value, float))
            except ValueError as error:
                wrong = f"{name}: expected an array of numbers, got {show(value)}"
                raise UserError(f"{self.name}: {wrong}") from error
        if type(self.made.attributes[name]) is int and float(cast(float, value)).is_integer():
            value = int(cast(float, value))  # a length, or the number of an element
        with self.fmu.explained(f"{name} = {show(value)}", self.name):
            setattr(self.made.object, name, copy.deepcopy(value))

    def _integer(self, reference: int) -> int:
        return self.switches[self._names[reference]]

    def discrete(self, name: str) -> int:
        if name in self.switches:
            return self.switches[name]
        return int(getattr(self.made.object, name))

    def _real_calls(self, references: Array, values: Array) -> tuple[Call, Call]:
        places, numbers = list(references), view(values)
        return partial(self.get_reals, places, numbers), partial(self.put_reals, places, numbers)

    def get_reals(self, places: Sequence[int], numbers: np.ndarray) -> None:
        """Write variables, by their references, into `numbers`."""
        own = len(self._exchanged)
        for i, place in enumerate(places):
            if place < own:
                numbers[i] = self.memory[place]
            else:
                name = self._names[place]
                numbers[i] = self._number(name, getattr(self.made.object, name), "attribute")

    def put_reals(self, places: Sequence[int], numbers: np.ndarray) -> None:
        self.memory[places] = numbers

    def get_switches(self, places: Sequence[int], values: np.ndarray) -> None:
        values[:] = [self.discrete(self._names[place]) for place in places]

    def put_switches(self, places: Sequence[int], values: np.ndarray) -> None:
        self.switches |= {
            self._names[x]: value for x, value in zip(places, values.tolist(), strict=True)
        }

    def input_polynomials(self, names: Sequence[str], order: int) -> InputPolynomials:
        return InputPolynomials(np.zeros((order + 1, len(names))), no_call)  # nor sets any

    # ---- Steps -----------------------------------------------------------------------------------

    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        result, when = self._called(start, length, self.memory[: self._count])
        for name in self.made.switched_outputs:
            self.switches[name] = self._switch(name, result[name], when)
        self.memory[self._count :] = self._reals(result, when)

    def stepped(self, start: float, length: float, inputs: np.ndarray) -> list[float]:
        """Call the user's step with Real inputs; return its Real outputs, in their order."""
        return self._reals(*self._called(start, length, inputs))

    def _called(
        self, start: float, length: float, inputs: np.ndarray
    ) -> tuple[Mapping[str, Any], str]:
        """Return what the user's step gives, all outputs and nothing else, and when."""
        when = f"in the step from t = {start!r} s"
        given = _Inputs(zip(self.made.inputs, inputs.tolist(), strict=True))
        for name in self.made.switched_inputs:
            given[name] = self.made.kinds[name](self.switches[name])
        try:  # explained() would take as long as a short step
            result = self.made.step(start, length, given)
        except UserError:
            raise
        except (Exception, SystemExit) as error:
            raise self.fmu.failure(error, when, self.name) from error
        if type(result) is dict and result.keys() == self._given:
            return result, when
        if not isinstance(result, Mapping):
            raise self._wrong(f"step: expected a dict of outputs, got {show(result)} {when}")
        for name in result:
            self._check_output(name, "step")
        outputs = [*self.made.outputs, *self.made.switched_outputs]
        missing = [name for name in outputs if name not in result]
        if missing:
            raise self._wrong(f"step: returned no {missing[0]!r} {when}")
        return result, when

    def _reals(self, result: Mapping[str, Any], when: str) -> list[float]:
        return [self._number(name, result[name], when) for name in self.made.outputs]

    def snapshot(self) -> Snapshot:
        return cast(Snapshot, _Snapshot(self))

    def save(self) -> Any:
        """Return a copy of what the user's save() gives."""
        with self.fmu.explained("save()", self.name):
            return copy.deepcopy(self.made.object.save())

    def restore(self, state: Any) -> None:
        with self.fmu.explained("restore(state)", self.name):
            self.made.object.restore(copy.deepcopy(state))

    # ---- Mistakes --------------------------------------------------------------------------------

    def _wrong(self, text: str) -> CodeError:
        return CodeError(f"{self.name}: {self.fmu.path}, line {self.made.line}: {text}")

    def _check_output(self, name: object, where: str) -> None:
        outputs = [*self.made.outputs, *self.made.switched_outputs]
        if name not in outputs:
            known = ", ".join(outputs) or "none"
            guess = did_you_mean(str(name), outputs)
            raise self._wrong(f"{where}: {name!r} is no output{guess} (outputs: {known})")

    def _number(self, name: str, value: Any, when: str) -> float:
        """Return a number that the user's code gives, which may be an array of one."""
        if type(value) is not float:
            numbers = np.asarray(value)
            if numbers.size != 1 or numbers.dtype.kind not in "fiub":
                raise self._wrong(f"{name}: expected a number, got {show(value)} ({when})")
            value = float(numbers.item())
        if not math.isfinite(value):
            raise self._wrong(f"{name} is {value}: expected a finite number ({when})")
        return value

    def _switch(self, name: str, value: Any, when: str) -> int:
        """Return a Boolean or Integer that the user's code gives."""
        number, of = self._number(name, value, when), self.made.kinds[name]
        least, greatest = (0, 1) if of is bool else INTEGER
        if not (number.is_integer() and least <= number <= greatest):
            expected = "True or False" if of is bool else "a whole number of 32 bits"
            raise self._wrong(f"{name}: expected {expected}, got {show(value)} ({when})")
        return int(number)


class _Snapshot:
    """A snapshot of an instance in Python, which does what one of an FMU does."""

    def __init__(self, instance: PythonInstance) -> None:
        self._instance = instance

    def take(self) -> None:
        of = self._instance
        self._kept = of.save(), of.memory.copy(), dict(of.switches)

    def restore(self) -> None:
        state, self._instance.memory[:], switches = self._kept
        self._instance.switches |= switches
        self._instance.restore(state)

    def free(self) -> None:
        pass


# ---- Called from C -------------------------------------------------------------------------------
class _Calls:
    """Functions of C with the names of FMI 2.0, for the loop; inputs and outputs are in memory."""

    component = INSTANCE

    def __init__(self, instance: PythonInstance) -> None:
        self._instance, self.dll = instance, self
        values = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, c_void_p)
        step = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
        self.fmi2GetReal = values(self._moved(instance.get_reals))
        self.fmi2GetBoolean = values(self._moved(instance.get_switches, c_int))
        self.fmi2SetBoolean = values(self._moved(instance.put_switches, c_int))
        self.fmi2GetInteger, self.fmi2SetInteger = self.fmi2GetBoolean, self.fmi2SetBoolean
        self.fmi2DoStep = step(lambda _, t, h, __: self._status(instance.do_step, t, h))

    def _moved(self, move: Callable[..., None], of: type = c_double) -> Callable[..., int]:
        def called(_: int, references: int, count: int, values: int) -> int:
            places = (c_uint * count).from_address(references)[:]
            memory = (of * count).from_address(values)
            return self._status(move, places, np.frombuffer(memory, of) if count else np.empty(0))

        return called

    def _status(self, function: Callable[..., None], *given: Any) -> int:
        try:
            function(*given)
        except BaseException as error:  # no other way leads out of a call of C
            self._instance._raised = error
            return ERROR
        return 0

"""The C of a file with equations, called directly: a struct model (src/model/model.h) by ctypes."""

import ctypes
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from rparm import build_cache
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
import building  # noqa: E402
from compiler.interface import Declaration  # noqa: E402
from compiler.read.content import FORCES  # noqa: E402
from compiler.read.model_file import ModelFile, ModelFileError, read  # noqa: E402
from compiler.write import c_model, declaration, lock  # noqa: E402

__all__ = [
    "Model", "ModelFileError", "building", "c_model", "declaration", "declared", "lock", "read",
    "read_text",
]  # fmt: skip

BUILD = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
LENGTH = 32  # SERIES_LENGTH
WORDS = ["size"] + [f"{part}_{key}" for part in "puxd" for key in ("offset", "size")]
# of struct model_events, up to this one
WORDS_OF_EVENTS = ["indicator_count", "indicator_names"]
WORDS_OF_EVENTS += [f"{part}_{key}" for part in ("modes", "discrete_states", "discrete_inputs")
                    for key in ("offset", "size")]  # fmt: skip
WORDS_OF_EVENTS += ["starts_follow", "next_time"]
WORDS += ["right_hand_side", "jacobian", "band", "series", "outputs", "derivatives", "check"]
WORDS += ["events", "anchors_offset", "anchors_size"]


class Words(ctypes.Structure):
    """struct model: words of 64 bits."""

    _fields_ = [(name, ctypes.c_size_t) for name in WORDS]


class Origin(ctypes.Structure):
    """struct series_origin."""

    _fields_ = [
        ("values", ctypes.c_void_p),
        ("t", ctypes.c_double),
        ("time_scale", ctypes.c_double),
        ("inputs", ctypes.c_void_p),
        ("has_avx2", ctypes.c_bool),
    ]


def read_text(folder: Path, text: str) -> ModelFile:
    """What a file with this text says."""
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    return read(path)


class Model:
    """The compiled model of a text; fields by name, `d_` in front of a state: its derivative."""

    def __init__(self, folder: Path, text: str, level: str = "-O1") -> None:
        self.file = read_text(folder, text)
        (folder / "equations.h").write_text(c_model.header(self.file))
        (folder / "equations.c").write_text(c_model.source(self.file))
        library = folder / "model.so"
        warnings = ["-Wall", "-Wextra", "-Wconversion", "-Werror", "-Wno-unused-parameter"]
        command = ["cc", "-std=c17", level, "-ffp-contract=off", "-shared", "-fPIC", *warnings]
        shared = ROOT / "src" / "model"
        runtime = [
            shared / name
            for name in (
                "algebraic.c",
                "relations.c",
                "relations_asked.c",
                "relations_modes.c",
                "contacts.c",
                "contacts_box.c",
                "contacts_checks.c",
                "contacts_decision.c",
                "contacts_impacts.c",
                "domains.c",
                "random.c",
            )
        ]
        sources = [folder / "equations.c", *runtime]
        files = [*sorted(shared.glob("*.?")), folder / "equations.h", folder / "equations.c"]
        texts = [path.read_bytes() for path in files]
        key = build_cache.digest([command, *build_cache.compilers("cc"), *texts])
        found = build_cache.of_user().get(key)
        if found is None:
            subprocess.run([*command, f"-I{shared}", *sources, "-o", library, "-lm"], check=True)
            build_cache.of_user().put(key, {"model.so": library.read_bytes()})
        else:
            library.unlink(missing_ok=True)  # one that is loaded stays as it is
            library.write_bytes(found["model.so"])
        self.library = ctypes.CDLL(str(library))
        self.words = Words.in_dll(self.library, "equations_model")
        text, fields = (folder / "equations.h").read_text(), self.file.fields
        states = [v.name for v in self.file.of("states")]
        own = [v for v in self.file.variables.values() if v.is_real and v.section != FORCES]
        names = {fields.value(v.name): v.name for v in own}
        names |= {fields.rate(name): f"d_{name}" for name in states}
        self.names = [names.get(place, place) for place in places("double", text)]
        self.ints = places("int", text)  # behind the doubles

    def values(self, **given: float) -> np.ndarray:
        """A value structure as an array; behind the doubles there are ints, the modes."""
        values = np.zeros(-(-self.words.size // 8))
        values[: len(self.names)] = [given.get(name, 0.0) for name in self.names]
        return values

    def _call(self, name: str, *arguments: object) -> None:
        function = ctypes.CFUNCTYPE(ctypes.c_int)(getattr(self.words, name))
        converted = [
            ctypes.c_void_p(a.ctypes.data) if isinstance(a, np.ndarray) else a for a in arguments
        ]
        function.argtypes = [type(a) for a in converted]
        assert function(*converted) == 0

    def next_time(self, values: np.ndarray) -> float:
        """The time of the next time event, s."""
        words = ctypes.cast(self.words.events, ctypes.POINTER(ctypes.c_size_t))
        function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)
        return function(words[WORDS_OF_EVENTS.index("next_time")])(values.ctypes.data)

    def outputs(self, values: np.ndarray, t: float) -> None:
        """Write the calculated fields."""
        self._call("outputs", values, ctypes.c_double(t))

    def derivatives(
        self, values: np.ndarray, t: float, dt: float, first: np.ndarray,
        second: np.ndarray | None,
    ) -> None:  # fmt: skip
        """Write the calculated fields of first and, while parameters rest, second derivatives."""
        below = ctypes.c_void_p() if second is None else second
        self._call("derivatives", values, ctypes.c_double(t), ctypes.c_double(dt), first, below)

    def jacobian(self, values: np.ndarray, t: float) -> np.ndarray:
        """Derivatives of the states' derivatives by the states."""
        states = [v.name for v in self.file.of("states")]
        inputs = [v.name for v in self.file.of("inputs")]
        x = np.array([values[self.names.index(name)] for name in states])
        u = np.array([values[self.names.index(name)] for name in inputs])
        J = np.zeros((len(states), len(states)), order="F")
        self._call("jacobian", values, ctypes.c_double(t), x, u, J)
        return J

    def series(
        self, values: np.ndarray, t: float, scale: float, inputs: np.ndarray, last: int,
        has_avx2: bool = False,
    ) -> np.ndarray:  # fmt: skip
        """Coefficients of the states (states, last + 1)."""
        count, extend = ctypes.c_size_t * 3, self.words.series
        row_count, _, function = count.from_address(extend)
        states = [v.name for v in self.file.of("states")]
        rows = np.full((row_count, LENGTH), np.nan)
        rows[: len(states), 0] = [values[self.names.index(name)] for name in states]
        origin = Origin(values.ctypes.data, t, scale, inputs.ctypes.data, has_avx2)
        call = ctypes.CFUNCTYPE(
            ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_void_p
        )(function)
        middle, of_other_scale = last // 2, Origin(origin.values, t, 3.0, origin.inputs, has_avx2)
        # order 0 may come from a series of another time scale
        calls = (of_other_scale, 0, 1), (origin, 1, middle), (origin, middle + 1, last)
        for of, first, end in calls:
            assert call(ctypes.addressof(of), first, end, rows.ctypes.data) == 0
        return rows[: len(states), : last + 1]


def places(kind: str, text: str) -> list[str]:
    """Fields of a type in equations.h, each element of an array."""
    found = re.findall(rf"^    {kind} (\w+)(?:\[(\d+)\])?;", text, re.MULTILINE)
    return [
        place
        for name, size in found
        for place in ([f"{name}[{i}]" for i in range(int(size))] if size else [name])
    ]


def declared(file: ModelFile) -> Declaration:
    """The declaration of a file without a lock file."""
    references = lock.references(Path("no-such-file"), declaration.keys(file))
    return declaration.declared(file, references)

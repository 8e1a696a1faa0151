"""The solvers in libbench.so: a plain loop of CVODE, the FMUs, MuJoCo."""

import ctypes
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from by_heyoka import START, STATES, Run, Work
from fmpy import read_model_description

from tests.equations.examples import METHODS

PLAIN_LOOP, FMU2, FMU3, MUJOCO_RK4, MUJOCO_IMPLICITFAST = range(5)  # bench.h
TOTALS = ("solver_steps", "solver_rhs_evaluations", "event_count")
FIGURES = ("internal_steps", "evaluations", "events")
Solver = Callable[[Work, float, int], Run]


class _Fmu(ctypes.Structure):
    """struct fmu."""

    _fields_ = (
        ("functions", ctypes.c_void_p), ("token", ctypes.c_char_p),
        ("real_count", ctypes.c_int), ("reals", ctypes.c_void_p),
        ("real_values", ctypes.c_void_p),
        ("choice_count", ctypes.c_int), ("choices", ctypes.c_void_p),
        ("choice_values", ctypes.c_void_p),
        ("inputs", ctypes.c_uint * 2), ("states", ctypes.c_uint * 4),
        ("effective_tolerance", ctypes.c_uint), ("totals", ctypes.c_uint * 3),
        ("total_count", ctypes.c_int),
    )  # fmt: skip


class _Task(ctypes.Structure):
    """struct task."""

    _fields_ = (
        ("solver", ctypes.c_int), ("tolerance", ctypes.c_double), ("substeps", ctypes.c_int),
        ("fmu", ctypes.POINTER(_Fmu)), ("step", ctypes.c_double), ("steps", ctypes.c_int),
        ("changes", ctypes.c_bool), ("start", ctypes.c_double * 4),
        ("inputs", ctypes.c_void_p), ("states", ctypes.c_void_p),
        ("effective_tolerance", ctypes.c_double), ("totals", ctypes.c_double * 3),
    )  # fmt: skip


class Solvers:
    """Those of a build."""

    def __init__(self, build: Path) -> None:
        self.build = build
        self.library = ctypes.CDLL(str(build / "tests/bench/libbench.so"))
        self.library.bench_open.restype = ctypes.c_void_p
        self.library.bench_run.restype = self.library.bench_life.restype = ctypes.c_double
        for name in ("bench_mujoco_version", "bench_made_by"):
            getattr(self.library, name).restype = ctypes.c_char_p
        self.made_by = self.library.bench_made_by().decode()
        self.mujoco_version = self.library.bench_mujoco_version().decode()
        self.opened = cache(self._open)

    def _open(self, name: str, version: int) -> tuple[int, str, dict[str, int]]:
        """The functions of an FMU, its token and its value references."""
        folder = self.build / "fmu" / name / ("fmi3" if version == 3 else "")
        functions = self.library.bench_open(str(folder / f"{name}.so").encode(), version)
        described = read_model_description(str(folder / "modelDescription.xml"), validate=False)
        token = described.guid if version == 2 else described.instantiationToken
        return functions, token, {x.name: x.valueReference for x in described.modelVariables}

    def task(self, solver: int, work: Work, tolerance: float) -> tuple[_Task, np.ndarray]:
        """A task, and where its states go. MuJoCo: substeps in place of a tolerance."""
        states = np.empty((work.steps, 4))
        inputs = np.ascontiguousarray(work.inputs)
        task = _Task(
            solver=solver, tolerance=tolerance, substeps=max(1, round(tolerance)),
            step=work.step, steps=work.steps, changes=work.kind == "changing",
            start=(ctypes.c_double * 4)(*work.start),
            inputs=inputs.ctypes.data, states=states.ctypes.data,
        )  # fmt: skip
        task.kept = inputs, states
        return task, states

    def plain(self, solver: int) -> Solver:
        """A solver that is no FMU."""

        def run(work: Work, tolerance: float, passes: int = 1) -> Run:
            task, states = self.task(solver, work, tolerance)
            return self.library.bench_run(ctypes.byref(task), passes), states, {}

        return run

    def fmu_task(
        self,
        name: str,
        version: int,
        method: str,
        values: Mapping[str, float | int],
        work: Work,
        tolerance: float,
    ) -> tuple[_Task, np.ndarray]:
        """A task of an FMU with these values; those that are integers are enumerations."""
        functions, token, references = self.opened(name, version)
        values = {"solver_method": METHODS[method], **values}
        chosen = {key: value for key, value in values.items() if isinstance(value, int)}
        reals = {key: value for key, value in values.items() if key not in chosen}
        arrays = (
            np.array([references[key] for key in reals], np.uint32),
            np.array([*reals.values()], float),
            np.array([references[key] for key in chosen], np.uint32),
            np.array([*chosen.values()], np.int32),
        )
        totals = [references[total] for total in TOTALS if total in references]
        fmu = _Fmu(
            functions, token.encode(),
            len(reals), arrays[0].ctypes.data, arrays[1].ctypes.data,
            len(chosen), arrays[2].ctypes.data, arrays[3].ctypes.data,
            (ctypes.c_uint * 2)(references["tau1"], references["f2"]),
            (ctypes.c_uint * 4)(*(references[state] for state in STATES)),
            references["effective_relative_tolerance"], (ctypes.c_uint * 3)(*totals), len(totals),
        )  # fmt: skip
        task, states = self.task(FMU2 if version == 2 else FMU3, work, tolerance)
        task.fmu = ctypes.pointer(fmu)
        task.kept_too = fmu, arrays
        return task, states

    def fmu(
        self, method: str, version: int = 2, name: str = "RPManipulator", **values: float | int
    ) -> Solver:
        """An FMU with a method; values: its parameters."""

        def run(work: Work, tolerance: float, passes: int = 1) -> Run:
            task, states = self.fmu_task(name, version, method, values, work, tolerance)
            seconds = self.library.bench_run(ctypes.byref(task), passes)
            figures = {"effective_tolerance": task.effective_tolerance}
            figures |= {
                x: total / work.steps for x, total in zip(FIGURES, task.totals, strict=True)
            }
            return seconds, states, figures

        return run

    def life(self, method: str, lives: int) -> tuple[float, float]:
        """Processor time of an instance without a step, s; its memory after one, KiB."""
        work = Work("a step", 1e-3, 1, "changing", START)
        task, _ = self.fmu_task("RPManipulator", 2, method, {}, work, 1e-8)
        kib = ctypes.c_double()
        seconds = self.library.bench_life(ctypes.byref(task), lives, ctypes.byref(kib))
        return seconds, kib.value

"""The arm and its controller as two federates of HELICS, compared with a plain loop.

The controller is granted times half a period after the arm's: it answers each state before the arm
makes its next step, so that nothing is delayed. Beside rparm it needs: pip install helics

PYTHONPATH=. build/venv/bin/python examples/helics_federate.py [PICTURE]
"""

import shutil
import sys
from concurrent.futures import ThreadPoolExecutor

import helics as h
import matplotlib.pyplot as plt
import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description

import rparm

STATES, EFFORTS = ("q1", "q2", "dq1", "dq2"), ("tau1", "f2")
OUTPUTS = (*STATES, "gravity1", "gravity2")
START = [-1.5, 0.2, 0.0, 0.0]  # rad, m, rad/s, m/s
GOAL = np.array([0.5, 0.1])  # rad, m
PERIOD, STEPS = 0.01, 200  # s


class Arm:
    """The FMU for co-simulation, from START on."""

    def __init__(self) -> None:
        path = rparm.fmu("RPManipulator")
        description = read_model_description(path)
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        self._folder = extract(path)
        self._fmi = instantiate_fmu(self._folder, description, fmi_type="CoSimulation")
        self._fmi.setupExperiment()
        self._fmi.enterInitializationMode()
        self._fmi.setReal([self._references[name] for name in STATES], START)
        self._fmi.exitInitializationMode()

    def outputs(self) -> list[float]:
        return self._fmi.getReal([self._references[name] for name in OUTPUTS])

    def step(self, k: int, efforts: list[float]) -> None:
        self._fmi.setReal([self._references[name] for name in EFFORTS], efforts)
        self._fmi.doStep(k * PERIOD, PERIOD)

    def close(self) -> None:
        self._fmi.freeInstance()
        shutil.rmtree(self._folder)


def control(outputs: list[float]) -> list[float]:
    """Return efforts of a PD controller with gravity compensation."""
    position, velocity, gravity = np.split(np.array(outputs), 3)
    return list(gravity + [60.0, 100.0] * (GOAL - position) - [15.0, 20.0] * velocity)


def joined(name: str, offset: float) -> h.HelicsValueFederate:
    """A federate that is granted the times k PERIOD + offset (s)."""
    info = h.helicsCreateFederateInfo()
    # one core for both, in this process
    h.helicsFederateInfoSetCoreTypeFromString(info, "inproc")
    h.helicsFederateInfoSetCoreName(info, "core")
    h.helicsFederateInfoSetCoreInitString(info, "--federates=2 --autobroker --loglevel=error")
    h.helicsFederateInfoSetTimeProperty(info, h.HELICS_PROPERTY_TIME_PERIOD, PERIOD)
    h.helicsFederateInfoSetTimeProperty(info, h.HELICS_PROPERTY_TIME_OFFSET, offset)
    return h.helicsCreateValueFederate(name, info)


def run_arm(me: h.HelicsValueFederate, arm: Arm) -> np.ndarray:
    """Return outputs of the arm at all communication points, (STEPS + 1, 6)."""
    outputs = h.helicsFederateRegisterPublication(me, "outputs", h.HELICS_DATA_TYPE_VECTOR)
    efforts = h.helicsFederateRegisterSubscription(me, "controller/efforts")
    try:
        h.helicsFederateEnterExecutingMode(me)
        rows = [arm.outputs()]
        for k in range(STEPS):
            h.helicsPublicationPublishVector(outputs, rows[-1])
            h.helicsFederateRequestTime(me, (k + 1) * PERIOD)
            arm.step(k, h.helicsInputGetVector(efforts))
            rows.append(arm.outputs())
        return np.array(rows)
    finally:
        h.helicsFederateDisconnect(me)  # else the other one would wait for ever


def run_controller(me: h.HelicsValueFederate) -> None:
    """Answer all outputs with efforts."""
    efforts = h.helicsFederateRegisterPublication(me, "efforts", h.HELICS_DATA_TYPE_VECTOR)
    outputs = h.helicsFederateRegisterSubscription(me, "arm/outputs")
    try:
        h.helicsFederateEnterExecutingMode(me)
        for k in range(STEPS):
            h.helicsFederateRequestTime(me, (k + 0.5) * PERIOD)
            h.helicsPublicationPublishVector(efforts, control(h.helicsInputGetVector(outputs)))
    finally:
        h.helicsFederateDisconnect(me)


def in_federation() -> np.ndarray:
    """Return outputs of the arm as a federate."""
    arm = Arm()
    federates = joined("arm", offset=0.0), joined("controller", offset=PERIOD / 2)
    with ThreadPoolExecutor() as threads:
        running = threads.submit(run_arm, federates[0], arm)
        controlling = threads.submit(run_controller, federates[1])
    h.helicsCloseLibrary()
    arm.close()
    controlling.result()
    return running.result()


def in_loop() -> np.ndarray:
    """The same without HELICS."""
    arm = Arm()
    rows = [arm.outputs()]
    for k in range(STEPS):
        arm.step(k, control(rows[-1]))
        rows.append(arm.outputs())
    arm.close()
    return np.array(rows)


def main() -> None:
    rows, expected = in_federation(), in_loop()
    print(f"ends at q1 = {rows[-1, 0]:.4f} rad, q2 = {rows[-1, 1]:.4f} m")
    print(f"largest difference from a plain loop: {np.abs(rows - expected).max():g}")

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
    times = PERIOD * np.arange(STEPS + 1)
    for axis, column, label in zip(axes, (0, 1), ("q1 (rad)", "q2 (m)"), strict=True):
        axis.plot(times, expected[:, column], label="plain loop")
        axis.plot(times[::5], rows[::5, column], ".", label="HELICS")
        axis.set_ylabel(label)
    axes[0].legend()
    axes[1].set_xlabel("time (s)")
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()

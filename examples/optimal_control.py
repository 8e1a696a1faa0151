"""Optimal control: the arm swings from hanging to standing with the least effort, by CasADi.

CasADi takes the equations from the FMU, and their exact derivatives; ipopt finds the efforts, which
then move the Co-Simulation FMU. Beside rparm it needs: pip install casadi

PYTHONPATH=. build/venv/bin/python examples/optimal_control.py [PICTURE]
"""

import sys

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import rparm

STATES = ("q1", "q2", "dq1", "dq2")
START = np.array([-np.pi / 2, 0.2, 0.0, 0.0])  # at rest; rad, m, rad/s, m/s
END = np.array([np.pi / 2, 0.2, 0.0, 0.0])
DURATION, INTERVALS = 2.0, 40  # s; efforts are held over an interval
INTERVAL = DURATION / INTERVALS
SLIDE = (0.0, 0.25)  # m, where q2 must stay
LIMITS = np.array([15.0, 30.0])  # of tau1 (N.m) and f2 (N)

FMU = rparm.fmu("RPManipulator", fmi=3)
rates = ca.DaeBuilder("arm", str(FMU)).create("rates", ["x", "u"], ["ode"])


def after_interval(x: ca.MX, u: ca.MX, steps: int = 4) -> ca.MX:
    """States an interval after the states x with efforts u: the classical Runge-Kutta method."""
    h = INTERVAL / steps
    for _ in range(steps):
        k1 = rates(x, u)
        k2 = rates(x + h / 2 * k1, u)
        k3 = rates(x + h / 2 * k2, u)
        k4 = rates(x + h * k3, u)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def usual_swing(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return states and efforts at a time (s), where positions are polynomials of degree five."""
    s, way = time / DURATION, (END - START)[:2]
    position = START[:2] + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
    velocity = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / DURATION
    acceleration = way * (60 * s - 180 * s**2 + 120 * s**3) / DURATION**2
    x = np.concatenate([position, velocity])
    free, by_tau1, by_f2 = (rates(x, u).full()[2:, 0] for u in ([0, 0], [1, 0], [0, 1]))
    mobility = np.column_stack([by_tau1 - free, by_f2 - free])  # inverse of the mass matrix
    return x, np.linalg.solve(mobility, acceleration - free)


def mean_square(u: np.ndarray) -> float:
    """Mean over time of the sum of squares of efforts, (2, times), relative to their limits."""
    return float(np.sum((u.T / LIMITS) ** 2) / u.shape[1])


def optimal_swing() -> tuple[np.ndarray, np.ndarray]:
    """States at the ends of the intervals, (4, INTERVALS + 1), and efforts, (2, INTERVALS)."""
    problem = ca.Opti()
    x, u = problem.variable(4, INTERVALS + 1), problem.variable(2, INTERVALS)
    problem.minimize(ca.sumsqr(u / ca.repmat(LIMITS, 1, INTERVALS)))
    problem.subject_to(x[:, 0] == START)
    problem.subject_to(x[:, -1] == END)
    for k in range(INTERVALS):
        problem.subject_to(x[:, k + 1] == after_interval(x[:, k], u[:, k]))
        problem.subject_to(problem.bounded(-LIMITS, u[:, k], LIMITS))
        problem.subject_to(problem.bounded(SLIDE[0], x[1, k], SLIDE[1]))
        problem.set_initial(x[:, k], usual_swing(k * INTERVAL)[0])
        problem.set_initial(u[:, k], usual_swing((k + 0.5) * INTERVAL)[1])
    problem.set_initial(x[:, -1], END)
    # an FMU has no second derivatives
    options = {"hessian_approximation": "limited-memory", "print_level": 0, "sb": "yes"}
    problem.solver("ipopt", {"print_time": False}, options)
    solution = problem.solve()
    return solution.value(x), solution.value(u)


def simulated(u: np.ndarray) -> rparm.Table:
    """The swing of the Co-Simulation FMU with efforts u, (2, INTERVALS)."""
    held = dict(zip(("tau1", "f2"), np.column_stack([u, u[:, -1]]), strict=True))
    start = dict(zip(STATES, START, strict=True))
    return rparm.simulate(
        FMU, stop_time=DURATION, step=INTERVAL, start_values=start, inputs=held, tolerance=1e-10
    )


def main() -> None:
    x, u = optimal_swing()
    table = simulated(u)
    times = table["time"]
    usual_x, usual_u = map(np.transpose, zip(*map(usual_swing, times), strict=True))
    print(f"effort {mean_square(u):.4f}, of the usual swing {mean_square(usual_u):.4f}")
    print(f"ends {max(abs(table[n][-1] - e) for n, e in zip(STATES, END, strict=True)):.1e} off")

    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7, 5), layout="constrained")
    for axis, row, name in zip(axes, (0, 1), ("q1 (rad)", "q2 (m)"), strict=False):
        axis.plot(times, x[row], times, usual_x[row], "--")
        axis.set_ylabel(name)
    axes[2].stairs(u[0], times, baseline=None)
    axes[2].plot(times, usual_u[0], "C1--")
    axes[2].set(xlabel="time (s)", ylabel="tau1 (N.m)")
    axes[0].legend(["optimal", "polynomial"])
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()

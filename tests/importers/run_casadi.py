"""CasADi: derivatives, integration by its cvodes, and an optimal control by its ipopt.

    run_casadi.py TASK FMU PLAN RESULT

PLAN: JSON with what the function of the task takes, RESULT: JSON with what it returns.
"""

import json
import sys
from pathlib import Path
from typing import Any

import casadi as ca


def jacobians(fmu: ca.DaeBuilder, x: list[float], u: list[float]) -> dict[str, Any]:
    """Derivatives of the states' derivatives and of all Real outputs by states and inputs."""
    fmu.set_y([name for name in fmu.y() if fmu.type(name) == "Float64"])
    blocks: dict[str, Any] = {"x": fmu.x(), "u": fmu.u(), "y": fmu.y()}
    for name in ("ode", "y"):
        function = fmu.create(f"all_{name}", ["x", "u"], [name])
        for by, block in zip("xu", function.jacobian()(x, u, 0), strict=True):
            blocks[f"{name}_{by}"] = ca.DM(block).full().tolist()
    return blocks


def motion(
    fmu: ca.DaeBuilder, x: list[float], u: list[float], times: list[float], tolerance: float
) -> dict[str, Any]:
    """States at the times, from x at the first one, with the inputs u held."""
    right_hand_side = fmu.create("right_hand_side", ["x", "u"], ["ode"])
    state = ca.MX.sym("x", len(x))
    inputs = ca.MX.sym("u", len(u))
    options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": 100000}
    integrator = ca.integrator(
        "integrator",
        "cvodes",
        {"x": state, "p": inputs, "ode": right_hand_side(state, inputs)},
        times[0],
        times,
        options,
    )
    return {"x": integrator(x0=x, p=u)["xf"].full().T.tolist()}


def control(
    fmu: ca.DaeBuilder, start: list[float], end: list[float], duration: float, intervals: int
) -> dict[str, Any]:
    """Inputs, each held over an interval, that lead from start to end with the least squares.

    Multiple shooting: four steps of the classical Runge-Kutta method an interval.
    """
    steps = 4
    h = duration / intervals / steps
    right_hand_side = fmu.create("right_hand_side", ["x", "u"], ["ode"])
    count = len(fmu.u())
    problem = ca.Opti()
    x = problem.variable(len(start), intervals + 1)
    u = problem.variable(count, intervals)
    for k in range(intervals):
        state = x[:, k]
        for _ in range(steps):
            k1 = right_hand_side(state, u[:, k])
            k2 = right_hand_side(state + h / 2 * k1, u[:, k])
            k3 = right_hand_side(state + h / 2 * k2, u[:, k])
            k4 = right_hand_side(state + h * k3, u[:, k])
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        problem.subject_to(x[:, k + 1] == state)
    problem.subject_to(x[:, 0] == start)
    problem.subject_to(x[:, -1] == end)
    problem.minimize(ca.sumsqr(u))
    # the FMU has no second derivatives
    options = {"ipopt.hessian_approximation": "limited-memory", "ipopt.print_level": 0}
    problem.solver("ipopt", options | {"print_time": False, "ipopt.tol": 1e-9})
    guess = ca.DM(start) + (ca.DM(end) - ca.DM(start)) @ ca.linspace(0, 1, intervals + 1).T
    problem.set_initial(x, guess)
    solution = problem.solve()
    return {
        "x": ca.DM(solution.value(x)).full().T.tolist(),
        "u": ca.DM(solution.value(u)).full().T.tolist(),
        "status": solution.stats()["return_status"],
        "cost": float(solution.value(problem.f)),
    }


def main() -> None:
    """Run the task of the command line."""
    task, path, plan, result = sys.argv[1:]
    arguments = json.loads(Path(plan).read_text(encoding="utf-8"))
    done = globals()[task](ca.DaeBuilder("fmu", path), **arguments)
    Path(result).write_text(json.dumps(done), encoding="utf-8")


if __name__ == "__main__":
    main()

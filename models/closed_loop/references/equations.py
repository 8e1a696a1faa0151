"""Equations of the closed loop in sympy, from positions and paths; nothing of the C code goes in.

The arm moves as in models/rp_manipulator/references/make_references.py: Euler-Lagrange,
from the positions of both centers of mass. The controller's inverse dynamics come from the same
Lagrangian with the controller's parameters. The reference is a path in the plane or in joint space,
an exact function of time, differentiated by sympy. Symbols are named like the variables, with the
component in front.
"""

import sympy as sp
from rparm.models.rp_manipulator.references.make_references import PARAMETERS, STATES, derive

REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
PATH = ("ee_x_ref", "ee_y_ref", "ee_vx_ref", "ee_vy_ref")
MODES = ("pd", "pd_gravity", "computed_torque")
# a circle that contains the axis of joint 1, and one that leaves it aside, unwind differently
PATHS = ("point_to_point", "line", "circle_around", "circle_aside")
PROGRESS_TERMS = 7

ARM = derive()
time = sp.Symbol("time")


def symbols(component: str, names: str | tuple[str, ...]) -> tuple[sp.Symbol, ...]:
    names = names.split() if isinstance(names, str) else names
    return tuple(sp.Symbol(f"{component}.{name}") for name in names)


def of(component: str, names: tuple[str, ...]) -> dict[sp.Symbol, sp.Symbol]:
    """Renames the symbols of the arm's equations."""
    return dict(zip(sp.symbols(names), symbols(component, names), strict=True))


def dynamics_terms() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """D(q), C(q, dq) dq and g(q) of the arm, by differentiation of the energies."""
    kinetic = sp.Matrix([ARM.outputs["kinetic_energy"]])
    potential = sp.Matrix([ARM.outputs["potential_energy"]])
    q, dq = sp.Matrix(sp.symbols(STATES[:2])), sp.Matrix(sp.symbols(STATES[2:]))
    momenta = kinetic.jacobian(dq).T
    velocity_terms = momenta.jacobian(q) * dq - kinetic.jacobian(q).T
    return momenta.jacobian(dq), velocity_terms, potential.jacobian(q).T


def law(mode: str) -> sp.Matrix:
    """Return efforts before the limits, (2, 1), of references, measurements and integral parts."""
    reference = sp.Matrix(symbols("controller", REFERENCES))
    measured = sp.Matrix(symbols("controller", STATES))
    error, rate_error = (reference[:4, :] - measured)[:2, :], (reference[:4, :] - measured)[2:, :]
    proportional = sp.diag(*symbols("controller", "Kp1 Kp2"))
    derivative = sp.diag(*symbols("controller", "Kd1 Kd2"))
    integral = sp.Matrix(symbols("controller", "integral1 integral2"))
    commanded = proportional * error + derivative * rate_error + integral

    believed = of("controller", (*PARAMETERS, *STATES))
    inertia, velocity_terms, gravity = (terms.subs(believed) for terms in dynamics_terms())
    if mode == "computed_torque":
        return inertia * (reference[4:, :] + commanded) + velocity_terms + gravity
    efforts = sp.diag(*symbols("controller", "inertia1 inertia2")) * commanded
    return efforts + gravity if mode == "pd_gravity" else efforts


def reference(path: str) -> dict[str, sp.Expr]:
    """Return outputs of the trajectory on a segment, as functions of time.

    The progress is a polynomial of the time in the segment: a share of the way, or for a circle the
    time for which the angle has moved at its full rate.
    """
    progress = sp.Symbol("progress")
    if path == "point_to_point":
        start = sp.Matrix(symbols("trajectory", "q1_from q2_from"))
        joints = start + progress * (sp.Matrix(symbols("trajectory", "q1_to q2_to")) - start)
        forward = dict(zip(sp.symbols(STATES[:2]), joints, strict=True))
        geometry = of("trajectory", ("l1", "a"))
        position = sp.Matrix(
            [ARM.outputs[name].subs(geometry).subs(forward) for name in ("ee_x", "ee_y")]
        )
    else:
        position, joints = _through_inverse_kinematics(path, progress)
    begin, *terms = symbols("segment", ("begin", *(f"c{i}" for i in range(PROGRESS_TERMS))))
    # nested, since heyoka cannot expand a power of zero
    polynomial = [sp.horner(sp.Poly(terms[::-1], progress)).subs(progress, time - begin)]
    for _ in range(2):
        terms = [i * term for i, term in enumerate(terms)][1:]
        polynomial.append(sp.horner(sp.Poly(terms[::-1], progress)).subs(progress, time - begin))
    done, rate, bend = polynomial
    slope = joints.diff(progress)
    values = (
        *joints,
        *(slope * rate),
        *(slope.diff(progress) * rate**2 + slope * bend),
        *position,
        *(position.diff(progress) * rate),
    )
    outputs = (value.subs(progress, done) for value in values)
    return dict(zip((*REFERENCES, *PATH), outputs, strict=True))


def _through_inverse_kinematics(path: str, progress: sp.Expr) -> tuple[sp.Matrix, sp.Matrix]:
    """Return the position of the end effector and the joints that hold it there.

    The direction from joint 1's axis is counted from a heading, at less than half a turn: the start
    of the line, the center of a circle aside, the radius of one around.
    """
    if path == "line":
        start = sp.Matrix(symbols("trajectory", "ee_x_from ee_y_from"))
        end = sp.Matrix(symbols("trajectory", "ee_x_to ee_y_to"))
        position = start + progress * (end - start)
        heading, heading_angle = start, sp.atan2(start[1], start[0])
    else:
        names = "x_center y_center radius start_angle frequency"
        x, y, radius, angle, frequency = symbols("trajectory", names)
        center, phase = sp.Matrix([x, y]), angle + 2 * sp.pi * frequency * progress
        along_radius = sp.Matrix([sp.cos(phase), sp.sin(phase)])
        position = center + radius * along_radius
        if path == "circle_around":
            heading, heading_angle = along_radius, phase
        else:
            heading, heading_angle = center, sp.atan2(y, x)

    l1, a = symbols("trajectory", "l1 a")
    whole_turns, sign = symbols("segment", "whole_turns sign")
    across = heading[0] * position[1] - heading[1] * position[0]
    direction = heading_angle + sp.atan2(across, heading.dot(position)) + 2 * sp.pi * whole_turns
    slide = sign * sp.sqrt(position.dot(position) - a**2)
    return position, sp.Matrix([direction - sp.atan2(a, slide), slide - l1])

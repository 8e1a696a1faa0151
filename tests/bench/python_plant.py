"""The arm as pythonfmu makes an FMU of a Python class: what an engineer without C would write.

pythonfmu wants the class and all that it needs in this one file.
"""

from math import ceil, cos, sin

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

LONGEST_STEP = 1e-3  # s, of the classical Runge-Kutta method inside a communication step


class PythonPlant(Fmi2Slave):
    """Equations (14) and (15) of the notes, solved for the accelerations."""

    author = "RPManipulator"
    description = "RP manipulator in Python, classical Runge-Kutta method"

    def __init__(self, **kwargs) -> None:
        super().__init__(**kwargs)
        self.m1, self.m2, self.I1z, self.I2z = 2.0, 1.0, 0.1, 0.05
        self.l1, self.lc1, self.a, self.g = 0.5, 0.25, 0.1, 9.81
        self.tau1 = self.f2 = 0.0
        self.q1 = self.q2 = self.dq1 = self.dq2 = 0.0
        for name in ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
            )
        for name in ("tau1", "f2"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("q1", "q2", "dq1", "dq2"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def derivatives(
        self, q1: float, q2: float, dq1: float, dq2: float
    ) -> tuple[float, float, float, float]:
        """Rates of q1, q2, dq1, dq2."""
        m2, a, g = self.m2, self.a, self.g
        length = self.l1 + q2
        m1_lc1 = self.m1 * self.lc1
        inertia = m1_lc1 * self.lc1 + self.I1z + self.I2z + m2 * length * length
        c, s = cos(q1), sin(q1)
        gravity1 = g * (m1_lc1 * c + m2 * (length * c - a * s))
        torque = self.tau1 - 2.0 * m2 * length * dq1 * dq2 - gravity1
        force = self.f2 + m2 * length * dq1 * dq1 - m2 * g * s
        ddq1 = (torque + a * force) / inertia
        return dq1, dq2, ddq1, force / m2 + a * ddq1

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by one communication step."""
        count = ceil(step_size / LONGEST_STEP - 1e-9)
        h = step_size / count
        q1, q2, dq1, dq2 = self.q1, self.q2, self.dq1, self.dq2
        f = self.derivatives
        for _ in range(count):
            k1, k2, k3, k4 = f(q1, q2, dq1, dq2)
            p1, p2, p3, p4 = f(
                q1 + 0.5 * h * k1, q2 + 0.5 * h * k2, dq1 + 0.5 * h * k3, dq2 + 0.5 * h * k4
            )
            r1, r2, r3, r4 = f(
                q1 + 0.5 * h * p1, q2 + 0.5 * h * p2, dq1 + 0.5 * h * p3, dq2 + 0.5 * h * p4
            )
            s1, s2, s3, s4 = f(q1 + h * r1, q2 + h * r2, dq1 + h * r3, dq2 + h * r4)
            q1 += h / 6.0 * (k1 + 2.0 * (p1 + r1) + s1)
            q2 += h / 6.0 * (k2 + 2.0 * (p2 + r2) + s2)
            dq1 += h / 6.0 * (k3 + 2.0 * (p3 + r3) + s3)
            dq2 += h / 6.0 * (k4 + 2.0 * (p4 + r4) + s4)
        self.q1, self.q2, self.dq1, self.dq2 = q1, q2, dq1, dq2
        return True

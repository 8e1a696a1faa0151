"""A pole is held up by FMUs only: plant, encoders, Kalman filter and state feedback.

The system is estimator/loop.toml; python-control computes the gains of the feedback.
Beside rparm it needs: pip install control

PYTHONPATH=. build/venv/bin/python examples/balanced_pole.py [PICTURE]
"""

import sys
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import rparm

HERE = Path(__file__).parent
PLANT, LOOP = HERE / "models" / "cart_and_pole.toml", HERE / "estimator" / "loop.toml"
STATES = ("x", "phi", "v", "omega")
PERIOD = 5e-3  # s


def gains() -> dict[str, float]:
    """Return the gains of a sampled LQR about the pole that stands."""
    model = rparm.linearize(PLANT, at={"phi": np.pi}, inputs=["force"]).zoh(PERIOD)
    (found,), _, _ = control.dlqr(model.A, model.B, np.diag([100.0, 100.0, 1.0, 1.0]), np.eye(1))
    return {f"law.k_{name}": float(gain) for name, gain in zip(STATES, found, strict=True)}


def balanced(**seeds: int) -> rparm.Table:
    """Run the system; seeds: of the noise of `encoder` and `law`."""
    parameters = gains() | {f"{name}.seed": seed for name, seed in seeds.items()}
    return rparm.System(LOOP).run("default", parameters=parameters)


def main() -> None:
    table = balanced()
    wrong = {name: table[f"observer.{name}"] - table[f"plant.{name}"] for name in STATES}
    sigmas = {name: table[f"observer.sigma_{name}"] for name in STATES}
    inside = np.mean([np.abs(wrong[name]) < 3 * sigmas[name] for name in STATES])
    off = np.degrees(np.abs(table["plant.phi"][200:] - np.pi).max())
    print(f"after 1 s: at most {off:.2f} deg off")
    print(f"within three sigma: {100 * inside:.1f} % of the estimates")

    figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
    axis.plot(table["time"], np.degrees(wrong["omega"]), lw=0.5, label="estimate of omega wrong")
    for sign in (-3, 3):
        axis.plot(table["time"], sign * np.degrees(sigmas["omega"]), "k--", lw=0.8)
    axis.set(xlabel="time (s)", ylabel="deg/s", ylim=(-15, 15), title="three sigma, dashed")
    axis.legend()
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()

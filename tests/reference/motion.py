"""Motions by Lagrange's equations and a general-purpose integrator: nothing of the C code is in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from reference import lagrangian
from scipy.integrate import solve_ivp


def motion(
    start: NDArray[np.float64], inputs: tuple[float, float], parameters: NDArray[np.float64], times: Any
) -> NDArray[np.float64]:
    """The states at `times` (s) from `start` with held inputs, shape (times, 6); small steps over kinks."""
    values = parameters.tolist()

    def rates(_time: float, x: NDArray[np.float64]) -> list[float]:
        a = lagrangian.accelerations(x.tolist(), inputs, values)
        return [x[1], a[0], x[3], a[1], x[5], a[2]]

    span = (times[0], times[-1])
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "max_step": 2e-3}
    return np.asarray(solve_ivp(rates, span, start, t_eval=times, **options).y.T)

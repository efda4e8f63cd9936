"""Rest points over height and torque: Figure 2.4, the slope, and the torque at which the wire is left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cosimulation.fmu_driver import FmuInstance, running_fmu
from cosimulation.fmu_file import OpenFmu
from cosimulation.linearise import Linearisation
from cosimulation.pantograph import TORQUE
from cosimulation.study.white_box.settings import StaticSettings
from fmu_builder.errors import FmuError
from identification.arrays import Array

Record = dict[str, Any]
_FURTHER = 100.0
"""How far beyond where the tangent crosses zero the critical torque is looked for [N.m]."""
LIFT = "1/z1"
"""Crossbar height per angle of the lower arm, turned round: 1 / (d zeta / d phi_1) [rad/m = N/(N.m)]."""


@dataclass(frozen=True, eq=False)
class StaticMap:
    """Contact force at rest.

    Attributes:
        heights: (heights,) [m].
        torques: The operating point in the middle, (torques,) [N.m].
        force: F_p, (heights, torques) [N].
        critical: Torque at which F_p is zero, (heights,) [N.m].
    """

    heights: Array
    torques: Array
    force: Array
    critical: Array

    @property
    def at_operating_point(self) -> Array:
        """F_p over the height at the operating point of the torque [N]."""
        return np.asarray(self.force[:, self.torques.size // 2])

    @property
    def from_line(self) -> Array:
        """Largest deviation of F_p from the straight line through the first and last torque, (heights,)."""
        share = (self.torques - self.torques[0]) / (self.torques[-1] - self.torques[0])
        line = self.force[:, :1] + np.outer(self.force[:, -1] - self.force[:, 0], share)
        return np.asarray(np.abs(self.force - line).max(axis=1))


def static_map(fmu: OpenFmu, wbm: str, settings: StaticSettings, limits: tuple[float, float]) -> StaticMap:
    """Initialise the FMU at every height and torque, which it does at rest, and read the contact force.

    Args:
        fmu: The white-box FMU.
        wbm: White-box set.
        settings: Of the grid.
        limits: Lowest and highest height [m].

    Raises:
        FmuError: It cannot rest there, or the force is not zero anywhere near where its slope promises it.
    """
    heights = np.linspace(*limits, settings.heights)
    torques = TORQUE + np.linspace(-settings.torque_span, settings.torque_span, settings.torques)
    with running_fmu(fmu, "static") as instance:
        rest = _Rest(instance, wbm)
        force = np.array([[rest.force(h, torque) for torque in torques] for h in heights])
        critical = np.array([rest.critical(h) for h in heights])
    return StaticMap(heights, torques, force, critical)


class _Rest:
    """The contact force of one instance at rest, again and again."""

    def __init__(self, instance: FmuInstance, wbm: str) -> None:
        self._instance, self._wbm, self._used = instance, wbm, False

    def force(self, height: float, torque: float) -> float:
        if self._used:
            self._instance.reset()
        self._used = True
        self._instance.initialise({"preset": self._wbm, "eta": float(height), "M_pa": float(torque)})
        return float(self._instance.get(["F_p"])[0])

    def critical(self, height: float) -> float:
        """Return the torque at which the force is zero."""
        force = self.force(height, TORQUE)
        slope = self.force(height, TORQUE + 1.0) - force
        bracket = (TORQUE - force / slope - _FURTHER, TORQUE)
        try:
            return float(brentq(lambda torque: self.force(height, torque), *bracket, xtol=1e-9))
        except ValueError as reason:
            what = f"its contact force at {height:g} m is not zero between {bracket} N.m ({reason})"
            raise FmuError.of(
                self._instance.fmu.path.name, what, "Give an FMU with a contact that pulls"
            ) from reason


def gain(linearisation: Linearisation, output: str, source: str) -> float:
    """Return d output / d input at rest, an entry of D - C A^-1 B."""
    row, column = linearisation.outputs.index(output), linearisation.inputs.index(source)
    settled = np.linalg.solve(linearisation.A, linearisation.B[:, column])
    return float(linearisation.D[row, column] - linearisation.C[row] @ settled)


def lift(linearisation: Linearisation) -> float | None:
    """Return d zeta / d phi_1 = z1 [m/rad], None of an FMU without the angle among its states."""
    if "phi_1" not in linearisation.states:
        return None
    return float(linearisation.C[linearisation.outputs.index("zeta"), linearisation.states.index("phi_1")])


def static_records(
    found: StaticMap, linearisations: Sequence[Linearisation], labels: Record
) -> Iterator[Record]:
    """Yield lowest, highest and span over the height of every static figure."""
    columns: dict[str, tuple[Array, str]] = {
        "F_p": (found.at_operating_point, "N"),
        "F_p away from a line in M_pa": (found.from_line, "N"),
        "dF_p/dM_pa": (np.array([gain(one, "F_p", "M_pa") for one in linearisations]), "N/(N.m)"),
        "M_crit": (found.critical, "N.m"),
    }
    levers = [one for one in map(lift, linearisations) if one is not None]
    if levers:
        columns[LIFT] = 1.0 / np.array(levers), "N/(N.m)"
    for what, (values, unit) in columns.items():
        low, high = float(values.min()), float(values.max())
        for statistic, value in (("lowest", low), ("highest", high), ("span", high - low)):
            yield {
                "measure": "static", "quantity": what, "statistic": statistic, **labels,
                "value": value, "unit": unit,
            }  # fmt: skip

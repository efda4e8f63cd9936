"""A local linear model network in NumPy: the equations as matrix products, to be read and edited.

An FMU holds this file in resources/, beside slave.py and parameter_set.json. It shares no line with the C
kernel of the native FMU, so that the one checks the other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_SMALLEST = 1e-100  # what is smaller becomes zero at a tick: denormal numbers would make rest slow
_START_PASSES = 100


def _significant(values: Any) -> Any:
    return np.where(np.abs(values) < _SMALLEST, 0.0, values)


def _interpolated(positions: Array, rows: Array, place: float) -> Array:
    """Return `rows` [K, ...] at `place`: linear in between, the end segments go on beyond the ends."""
    cell, f = _cell(positions, place)
    return np.asarray((1.0 - f) * rows[cell] + f * rows[cell + 1])


def _cell(positions: Array, place: float) -> tuple[int, float]:
    """Return the cell of `place` and where in it the place lies, 0 at its left end and 1 at its right."""
    cell = int(np.clip(np.searchsorted(positions, place, side="right") - 1, 0, len(positions) - 2))
    return cell, (place - positions[cell]) / (positions[cell + 1] - positions[cell])


class Network:
    """The network of a parameter set (format 1 to 3) with m inputs, p outputs, M local models of n states.

    Thesis eq. 3.98 (outputs blended) or 3.100-3.101 (matrices blended). K models carry a state of their own:
    M with output blending, else 1.

    Attributes:
        x: States [K, n].
        validity: [M], at the last tick.
        in_range: Whether the last tick lay in the trained region: its inputs, how far the scheduling input
            had moved, and the derived outputs of the state and these inputs.
    """

    def __init__(self, content: dict[str, Any]) -> None:
        partition, offsets, table = content["partition"], content["offsets"], content["node_table"]
        self.sample_time: float = content["sample_time"]
        self.kind: str = offsets["kind"]
        self.by_model = content["blending"] == "output"
        self.partition, self.derived = partition, content["derived_outputs"]

        inputs, outputs = content["inputs"], content["outputs"]
        self.input_names = [signal["name"] for signal in inputs]
        self.output_names = [signal["name"] for signal in outputs]
        self.u_op = np.array([signal["operating_point"] for signal in inputs])
        self.y_op = np.array([signal["operating_point"] for signal in outputs])
        self.minimum = np.array([signal["minimum"] for signal in inputs])
        self.maximum = np.array([signal["maximum"] for signal in inputs])
        self.s = self.input_names.index(partition["scheduling"])
        region = content.get("trained_region")  # of format 3
        self.trained_move = math.inf if region is None else region["rate"] * self.sample_time
        spans = {} if region is None else region["derived_outputs"]
        everything = (-math.inf, math.inf)
        limits = np.array([spans.get(one["name"], everything) for one in self.derived]).reshape(-1, 2)
        self.derived_minimum, self.derived_maximum = limits.T

        self.nodes = None if table is None else np.array(table["positions"])
        self.node_validity = None if table is None else np.array(table["weights"])
        models = content["local_models"] if table is None or self.by_model else table["models"]
        named = ("A", "B", "C", "D", "g", "x0", "u0", "y0")
        self.stacked = {name: np.array([m[name] for m in models]) for name in named if models[0][name]}
        if self.kind == "scheduled_equilibrium":  # the moving equilibrium stands for the scheduling input
            self.stacked["B"][:, :, self.s] = 0.0

        self.static_map = offsets["static_map"] and {k: np.array(v) for k, v in offsets["static_map"].items()}
        corner = offsets["corner_frequency"]
        self.low_pass_gain = 0.0 if corner is None else -math.expm1(-2 * math.pi * corner * self.sample_time)
        self.kappa: float = partition["deviation_gain"]
        output = partition["deviation_output"]
        self.deviation_row = None if output is None else self.output_names.index(output)

        self.x: Array = np.zeros((len(models) if self.by_model else 1, len(models[0]["A"])))
        self.low_pass = self.height = 0.0
        self.g_before = np.zeros_like(self.x)
        self.deviation = 0.0
        self.validity = np.zeros(len(content["local_models"]))
        self.in_range = True
        self.held = np.zeros(len(outputs))
        self.feedthrough = np.zeros((len(outputs), len(inputs)))

    def start(self, u: Array) -> None:
        """Enter the steady state for the inputs u [m]: x = A (x - x0) + B (u - u0).

        Raises:
            numpy.linalg.LinAlgError: There is none.
        """
        self.low_pass = self.height = float(u[self.s])
        self.deviation = 0.0
        for _ in range(_START_PASSES if self.kappa else 1):
            before = self.deviation
            self._schedule(self.height + self.kappa * self.deviation)
            A, x0 = self._blended("A"), self._x0()
            drive = self._drive(u) - _times(A, x0)
            rest = np.linalg.solve(np.eye(A.shape[1]) - A, drive[..., None])
            self.x = np.asarray(rest[..., 0], dtype=np.float64)
            self._hold()
            if self.deviation == before:
                break
        if self.kind == "scheduled_equilibrium":
            self.g_before = self._blended("g")
        self.in_range = self._inside(u)

    def tick(self, u: Array) -> None:
        """Go from t_n to t_n+1 with the inputs u [m] in force at t_n."""
        self.in_range = self._inside(u)
        change, self.height = float(u[self.s]) - self.height, float(u[self.s])
        if self.kind == "low_pass":
            filtered = self.low_pass + self.low_pass_gain * (self.height - self.low_pass)
            self.low_pass = float(_significant(filtered))
            self._schedule(self.low_pass)
        else:
            self._schedule(self.height + self.kappa * self.deviation)
        if self.kind == "scheduled_equilibrium":  # x counts from a rest that moves by g per unit of height
            g = self._blended("g")
            self.x = self.x - 0.5 * (g + self.g_before) * change
            self.g_before = g
        self.x = _significant(_times(self._blended("A"), self.x - self._x0()) + self._drive(u))
        self._hold()

    def outputs(self, u: Array) -> Array:
        """Return outputs and derived outputs [p + R] with the inputs u [m] set last."""
        y = self.held + self.feedthrough @ self._deviation_of(u, self.u_op)
        signals = {
            **dict(zip(self.input_names, u, strict=True)),
            **dict(zip(self.output_names, y, strict=True)),
        }
        derived = [
            sum(
                term["sign"] * output["parameters"][term["parameter"]]["value"] * signals[term["signal"]]
                for term in output["terms"]
            )
            for output in self.derived
        ]
        return np.array([*y, *derived])

    def _inside(self, u: Array) -> bool:
        low, high = self.partition["range"]
        trained = bool(np.all((self.minimum <= u) & (u <= self.maximum)))
        slow = abs(float(u[self.s]) - self.height) <= self.trained_move
        forces = self.outputs(u)[len(self.y_op) :]
        known = bool(np.all((self.derived_minimum <= forces) & (forces <= self.derived_maximum)))
        return trained and low <= float(u[self.s]) <= high and slow and known

    def _schedule(self, place: float) -> None:
        """Set the validities, and which models are blended with which weights."""
        place = float(np.clip(place, *self.partition["range"]))
        if self.nodes is None or self.node_validity is None:  # normalised Gaussians, thesis eq. 3.10-3.11
            sigma = self.partition["k_sigma"] * np.array(self.partition["spreads"])
            logarithm = -0.5 * ((place - np.array(self.partition["centres"])) / sigma) ** 2
            memberships = np.exp(logarithm - logarithm.max())
            self.validity = memberships / memberships.sum()
        else:
            self.validity = _interpolated(self.nodes, self.node_validity, place)
        self.active, self.mix = slice(None), self.validity
        if self.nodes is not None and not self.by_model:
            cell, f = _cell(self.nodes, place)
            self.active, self.mix = slice(cell, cell + 2), np.array([1.0 - f, f])

    def _blended(self, name: str) -> Array:
        """Return a matrix or vector of every model that has a state [K, ...]."""
        stacked = self.stacked[name]
        return stacked if self.by_model else np.tensordot(self.mix, stacked[self.active], 1)[None]

    def _x0(self) -> Array:
        return self._blended("x0") if self.kind == "affine" else np.zeros_like(self.x)

    def _deviation_of(self, u: Array, reference: Array) -> Array:
        """Return u - reference [..., m]; a low-passed scheduling input counts from its low-pass."""
        deviation = u - reference
        if self.kind == "low_pass":
            deviation[..., self.s] = u[self.s] - self.low_pass
        return np.asarray(deviation)

    def _drive(self, u: Array) -> Array:
        """Return B (u - u0) [K, n]."""
        B = self._blended("B")
        reference = self._blended("u0") if self.kind == "affine" else np.tile(self.u_op, (len(B), 1))
        return _times(B, self._deviation_of(u, reference))

    def _hold(self) -> None:
        """Set what outputs hold until the next tick: everything but the effect of u through D."""
        share = self.validity if self.by_model else np.ones(1)
        each = _times(self._blended("C"), self.x - self._x0())
        if self.deviation_row is not None and self.kappa:
            self.deviation = float(share @ each[:, self.deviation_row])
        if self.kind == "affine":  # thesis eq. 3.32-3.34
            each = each + self._blended("y0") + _times(self._blended("D"), self.u_op - self._blended("u0"))
        self.held = self._rest() + share @ each
        self.feedthrough = np.tensordot(share, self._blended("D"), 1)

    def _rest(self) -> Array:
        """Return what the outputs of the models are added to."""
        if self.static_map:
            place = self.low_pass if self.kind == "low_pass" else self.height
            return _interpolated(self.static_map["positions"], self.static_map["values"], place)
        return np.zeros_like(self.y_op) if self.kind == "affine" else self.y_op

    def state(self) -> dict[str, Any]:
        """Return all that a tick or an output depends on, as JSON types without loss."""
        arrays = ("x", "g_before", "validity", "held", "feedthrough")
        numbers = ("low_pass", "height", "deviation", "in_range")
        return {name: getattr(self, name).tolist() for name in arrays} | {
            n: getattr(self, n) for n in numbers
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `state`."""
        for name, value in state.items():
            setattr(self, name, np.array(value) if isinstance(value, list) else value)


def _times(matrices: Array, vectors: Array) -> Array:
    """Return one product per model: [K, i, j] times [K, j]."""
    return np.asarray(np.einsum("kij,kj->ki", matrices, vectors))

"""The equations of `c/kernel.h` in scalar Python, read straight from the parameter set: the bit oracle.

Same order of operations, one number at a time, matrices as the parameter set holds them (row by row), so
neither the packing of the tables nor the compiler can hide a mistake. Slow on purpose; `simulate` of the
kernel is for work.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel.contact import contact_of, no_contact
from fmu_builder.kernel.scalar_algebra import (
    Blend,
    Row,
    between,
    blended,
    blended_matrix,
    cell_of,
    fraction_of,
    solve,
    times,
)
from fmu_builder.parameter_set import LocalLinearModel, ParameterSet, Partition, StaticMap

_FACTORIALS = [1.0 / math.factorial(n) for n in range(15)]
_START_PASSES = 100  # KERNEL_START_PASSES of kernel.h
_SMALLEST = 1e-100  # what is smaller than this becomes zero at a tick: no denormal numbers (c/kernel.h)
_LOG_SMALLEST = -230.0  # the same for a log-weight below the largest one


def exponential(x: float) -> float:
    """Return exp(x) with the bits of `elementary_exp` in c/elementary.c, which explains the steps."""
    if math.isnan(x):
        return x
    if x > 710.0:
        return math.inf
    if x < -746.0:
        return 0.0
    scaled = x * 1.4426950408889634
    k = int(scaled + (0.5 if scaled >= 0.0 else -0.5))
    high = x - k * float.fromhex("0x1.62e42feep-1")
    low = k * float.fromhex("0x1.a39ef35793c76p-33")
    r = high - low
    tail = _FACTORIALS[13] + r * _FACTORIALS[14]
    for n in range(12, 1, -1):
        tail = _FACTORIALS[n] + r * tail
    result = 1.0 + (high + (r * r * tail - low))
    half = int(k / 2)  # towards zero, as C divides
    return result * math.ldexp(1.0, half) * math.ldexp(1.0, k - half)


def significant(value: float) -> float:
    """Return `value`, or zero where it is too small to matter."""
    return 0.0 if -_SMALLEST < value < _SMALLEST else value


def log_weight_coefficients(partition: Partition) -> list[tuple[float, float, float]]:
    """Return (constant, slope, curvature) of every Gaussian's log-weight over d = r - middle (eq. 3.11).

    -(r - centre)^2 / (2 sigma^2), sigma = k_sigma * spread, multiplied out; the first model's curvature is
    taken from all of them, because a common term cancels in the normalisation: equal widths leave straight
    lines.
    """
    middle = range_middle(partition)
    coefficients = []
    for centre, spread in zip(partition.centres, partition.spreads or (), strict=True):
        sigma = (partition.k_sigma or 1.0) * spread
        precision, distance = 1.0 / (sigma * sigma), centre - middle
        coefficients.append((-0.5 * precision * distance * distance, precision * distance, -0.5 * precision))
    common = coefficients[0][2]
    return [(constant, slope, curvature - common) for constant, slope, curvature in coefficients]


def range_middle(partition: Partition) -> float:
    """Return the middle of the range."""
    return 0.5 * (partition.range[0] + partition.range[1])


def low_pass_gain(corner_frequency: float, sample_time: float) -> float:
    """Return 1 - exp(-2 pi f Ts): the step response of the low-pass after one tick."""
    return 1.0 - exponential(-2.0 * math.pi * corner_frequency * sample_time)


class Network:
    """The network with its state; `start`, then `tick` and `outputs` as often as wanted.

    Attributes:
        x: States of the blend, or of every local model with output blending.
        weights: [M] validities at the last tick.
        in_range: Whether the last tick lay in the trained region.
        given: Scheduling input of the last tick before a contact acts on it.
        deviation: (C x)_j of the last tick, which also schedules.
        position: r of the last tick.
        outside: Whether a tick has moved r by more than `certified_move`, if that is not 0.
    """

    def __init__(
        self,
        parameter_set: ParameterSet,
        *,
        unilateral: bool = False,
        certified_move: float = 0.0,
        limited: bool = False,
    ) -> None:
        self.set = parameter_set
        self.limited = limited
        self.region = parameter_set.trained_region
        self.given = 0.0
        self.contact = contact_of(parameter_set) if unilateral else None
        self.certified_move = certified_move
        self.position = 0.0
        self.outside = False
        self.kind = parameter_set.offsets.kind
        self.output_blending = parameter_set.blending == "output"
        self.u_op = [signal.operating_point for signal in parameter_set.inputs]
        self.y_op = [signal.operating_point for signal in parameter_set.outputs]
        matrices = [model.D for model in self._models()]
        self.has_feedthrough = any(entry != 0.0 for D in matrices for row in D for entry in row)
        self.x: list[list[float]] = []
        self.weights: list[float] = []
        self.in_range = True
        self.deviation = 0.0
        self.kappa = parameter_set.partition.deviation_gain
        names = [signal.name for signal in parameter_set.outputs]
        output = parameter_set.partition.deviation_output
        self.deviation_index = 0 if output is None else names.index(output)

    def start(self, inputs: Row) -> None:
        """Enter the steady state for `inputs` [m].

        Raises:
            ParameterSetError: There is none.
        """
        index, given = self.set.scheduling_index, inputs
        inputs = self._limited(inputs)
        self.low_pass = self.held_scheduling = self.given = inputs[index]
        self.outside = False
        self.deviation = 0.0
        self._settle(inputs)
        for _ in range(_START_PASSES - 1 if self.kappa != 0.0 else 0):
            before = self.deviation
            self._settle(inputs)
            if self.deviation == before:
                break
        if self.contact is not None and inputs[index] > self.held[self.contact.output]:
            raise no_contact()
        self.in_range = self._inside(given)

    def _acting(self, inputs: Row, ahead: float) -> list[float]:
        """Return the inputs with min(u_s, y + ahead y_dot) for the wire u_s that the pan-head y may leave."""
        acting = list(inputs)
        if self.contact is not None:
            position = self.held[self.contact.output] + ahead * self.held[self.contact.rate]
            index = self.set.scheduling_index
            acting[index] = position if acting[index] > position else acting[index]
        return acting

    def _settle(self, inputs: Row) -> None:
        count = len(self.set.local_models) if self.output_blending else 1
        self.x = [[0.0] * self.set.state_count for _ in range(count)]
        blend = self._schedule(self._scheduling(self.held_scheduling))
        self._advance(blend, inputs)
        settled = [[(model, 1.0)] for model in self.set.local_models] if self.output_blending else [blend]
        for models, x in zip(settled, self.x, strict=True):
            matrix = blended_matrix(models, lambda model: model.A)
            for i, row in enumerate(matrix):
                matrix[i] = [(1.0 if i == j else 0.0) - entry for j, entry in enumerate(row)]
            if not solve(matrix, x):
                what = "the model has no steady state for the start inputs"
                raise ParameterSetError.of("local_models", what, "Give models without eigenvalue 1")
        if self.kind == "scheduled_equilibrium" and not self.output_blending:
            self.g = blended(blend, lambda model: model.g or ())
        self._hold(blend)

    def tick(self, inputs: Row) -> None:
        """Go from t_n to t_n+1 with the inputs [m] in force at t_n."""
        self.in_range = self._inside(inputs)
        inputs = self._followed(inputs)
        self.given = inputs[self.set.scheduling_index]
        inputs = self._acting(inputs, 0.5 * self.set.sample_time)
        scheduling = inputs[self.set.scheduling_index]
        change = scheduling - self.held_scheduling
        if self.kind == "low_pass":
            gain = low_pass_gain(self.set.offsets.corner_frequency or 0.0, self.set.sample_time)
            self.low_pass = significant(self.low_pass + gain * (scheduling - self.low_pass))
        position = self.low_pass if self.kind == "low_pass" else self._scheduling(scheduling)
        before = self.position
        blend = self._schedule(position)
        self.outside = self.outside or 0.0 < self.certified_move < abs(self.position - before)
        self.held_scheduling = scheduling
        if self.kind == "scheduled_equilibrium":
            self._rebase(blend, change)
        self._advance(blend, inputs)
        self._hold(blend)

    def outputs(self, inputs: Row) -> list[float]:
        """Return the outputs [p] and derived outputs [R] with `inputs` [m] set last."""
        inputs = self._acting(self._followed(inputs), 0.0)
        values = list(self.held)
        if self.has_feedthrough:
            times(self.feedthrough, self._deviation(inputs, self.u_op), values)
        signals = dict(zip(self.set.input_names, inputs, strict=True))
        signals |= zip(self.set.output_names, values, strict=False)
        for derived in self.set.derived_outputs:
            total = 0.0
            for term in derived.terms:
                total += term.sign * derived.parameters[term.parameter].value * signals[term.signal]
            values.append(total)
        return values

    def _models(self) -> Sequence[LocalLinearModel]:
        table = self.set.node_table
        return self.set.local_models if table is None or self.output_blending else table.models

    def _inside(self, inputs: Row) -> bool:
        """Return whether the inputs given, their move and the derived outputs keep the trained limits."""
        (low, high), s = self.set.partition.range, inputs[self.set.scheduling_index]
        pairs = zip(self.set.inputs, inputs, strict=True)
        inside = (
            all(signal.minimum <= value <= signal.maximum for signal, value in pairs) and low <= s <= high
        )
        if self.region is None:
            return inside
        values = dict(zip(self.set.output_names, self.outputs(inputs), strict=True))
        forces = all(low <= values[name] <= high for name, (low, high) in self.region.derived_outputs.items())
        return inside and forces and abs(s - self.given) <= self.region.rate * self.set.sample_time

    def _limited(self, inputs: Row) -> Row:
        """Return the inputs, where they are limited between their trained limits."""
        if not self.limited:
            return inputs
        result = [
            min(max(u, one.minimum), one.maximum) for one, u in zip(self.set.inputs, inputs, strict=True)
        ]
        (low, high), index = self.set.partition.range, self.set.scheduling_index
        result[index] = min(max(result[index], low), high)
        return result

    def _followed(self, inputs: Row) -> Row:
        """Return limited inputs, the scheduling one no further from the last tick's than in training."""
        result = list(self._limited(inputs))
        if self.limited and self.region is not None:
            index, most = self.set.scheduling_index, self.region.rate * self.set.sample_time
            move = result[index] - self.given
            result[index] = result[index] if abs(move) <= most else self.given + math.copysign(most, move)
        return result

    def _scheduling(self, s: float) -> float:
        return s if self.kappa == 0.0 else s + self.kappa * self.deviation

    def _schedule(self, scheduling: float) -> Blend:
        """Set the weights; return the models a blend consists of."""
        partition, table = self.set.partition, self.set.node_table
        low, high = partition.range
        r = low if scheduling < low else high if scheduling > high else scheduling
        self.position = r
        if table is not None:
            self.weights = between(table.positions, table.weights, r)
            if not self.output_blending:
                cell = cell_of(table.positions, r)
                f = fraction_of(table.positions, cell, r)
                return [(table.models[cell], 1.0 - f), (table.models[cell + 1], f)]
        else:
            d = r - range_middle(partition)
            logs = [(c * d + b) * d + a for a, b, c in log_weight_coefficients(partition)]
            falls = [value - max(logs) for value in logs]
            exponentials = [0.0 if fall < _LOG_SMALLEST else exponential(fall) for fall in falls]
            total = 0.0
            for value in exponentials:
                total += value
            inverse = 1.0 / total
            self.weights = [value * inverse for value in exponentials]
        return list(zip(self.set.local_models, self.weights, strict=True))

    def _deviation(self, inputs: Row, reference: Row) -> list[float]:
        deviation = [u - rest for u, rest in zip(inputs, reference, strict=True)]
        if self.kind == "low_pass":
            index = self.set.scheduling_index
            deviation[index] = inputs[index] - self.low_pass
        return deviation

    def _transition(self, model: LocalLinearModel, x: Row, deviation: Row) -> list[float]:
        result = [0.0] * len(x)
        times(model.A, x, result)
        for column, value in enumerate(deviation):
            if self.kind != "scheduled_equilibrium" or column != self.set.scheduling_index:
                times([[row[column]] for row in model.B], [value], result)
        return result

    def _rebase(self, blend: Blend, change: float) -> None:
        if self.output_blending:
            for model, x in zip(self.set.local_models, self.x, strict=True):
                x[:] = [value - g * change for value, g in zip(x, model.g or (), strict=True)]
            return
        g = blended(blend, lambda model: model.g or ())
        self.x[0] = [
            value - (0.5 * (now + before)) * change
            for value, now, before in zip(self.x[0], g, self.g, strict=True)
        ]
        self.g = g

    def _advance(self, blend: Blend, inputs: Row) -> None:
        if self.output_blending:
            for index, model in enumerate(self.set.local_models):
                x, deviation = self.x[index], self._deviation(inputs, model.u0 or self.u_op)
                following = self._transition(model, self._shifted(x, model.x0), deviation)
                x[:] = [significant(value) for value in following]
            return
        x0, u0 = self._affine(blend)
        source, deviation = self._shifted(self.x[0], x0), self._deviation(inputs, u0)
        following = [0.0] * len(source)
        for model, weight in blend:
            for index, value in enumerate(self._transition(model, source, deviation)):
                following[index] += weight * value
        self.x[0] = [significant(value) for value in following]

    def _affine(self, blend: Blend) -> tuple[Row | None, Row]:
        if self.kind != "affine":
            return None, self.u_op
        return blended(blend, lambda model: model.x0 or ()), blended(blend, lambda model: model.u0 or ())

    @staticmethod
    def _shifted(x: Row, x0: Row | None) -> list[float]:
        return list(x) if x0 is None else [value - rest for value, rest in zip(x, x0, strict=True)]

    def _hold(self, blend: Blend) -> None:
        """Set the outputs without feedthrough, and the blended D [p][m]."""
        static_map: StaticMap | None = self.set.offsets.static_map
        if static_map is not None:
            position = self.low_pass if self.kind == "low_pass" else self.held_scheduling
            self.held = between(static_map.positions, static_map.values, position)
        else:
            self.held = [0.0] * len(self.y_op) if self.kind == "affine" else list(self.y_op)
        self.feedthrough = blended_matrix(blend, lambda model: model.D)
        x0, u0 = self._affine(blend)
        self.deviation = 0.0
        for index, (model, weight) in enumerate(blend):
            if self.output_blending:
                x0, u0 = model.x0, model.u0 or self.u_op
            source = self._shifted(self.x[index if self.output_blending else 0], x0)
            product = [0.0] * len(self.held)
            times(model.C, source, product)
            if self.kappa != 0.0:
                self.deviation += weight * product[self.deviation_index]
            if model.y0 is not None:
                product = [value + rest for value, rest in zip(product, model.y0, strict=True)]
                if self.has_feedthrough:
                    times(model.D, self._deviation(self.u_op, u0), product)
            self.held = [value + weight * part for value, part in zip(self.held, product, strict=True)]


def simulate(
    parameter_set: ParameterSet, inputs: Sequence[Row], unilateral: bool = False
) -> list[list[float]]:
    """Return the outputs and derived outputs [N][p + R] for the inputs [N][m].

    Row k is read after the inputs of row k were set and before the tick that uses them; row 0 is the steady
    state.

    Raises:
        ParameterSetError: The model has no steady state for the first inputs, or none with contact where it
            is unilateral.
    """
    network = Network(parameter_set, unilateral=unilateral)
    network.start(inputs[0])
    rows = [network.outputs(inputs[0])]
    for previous, present in pairwise(inputs):
        network.tick(previous)
        rows.append(network.outputs(present))
    return rows

"""A network of local ARX models: identification, one-step prediction and free run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fmu_builder.errors import DataError, IdentificationError, Problem
from identification.arrays import Array
from identification.data_set import DataSet
from identification.lolimot.regression import Orders, differences, regressors
from identification.lolimot.settings import LolimotSettings
from identification.lolimot.tree import Cells, Grower, Growth
from identification.scores import moves


@dataclass(frozen=True, eq=False)
class ArxNetwork:
    """y(k) = sum_i phi_i(z(k-1)) (a_i y(k-1 ..) + b_i u(k-delay ..) + c_i), in deviations from one point.

    With M local models of r regressors each (`regression.Orders`).

    Attributes:
        settings: What it was identified with.
        inputs: Names of the m inputs.
        output: Name of the output.
        sample_time: s, between two rows of the model.
        orders: What a row of regressors holds.
        cells: The partition, ascending by centre.
        parameters: a, b and c per local model, shape (M, r).
        input_point: What deviations of the inputs are counted from, shape (m,).
        output_point: The same of the output.
        growth: How the tree grew.
    """

    settings: LolimotSettings
    inputs: tuple[str, ...]
    output: str
    sample_time: float
    orders: Orders
    cells: Cells
    parameters: Array
    input_point: Array
    output_point: float
    growth: tuple[Growth, ...] = ()

    def weights(self, inputs: Array) -> Array:
        """Return the validities at inputs of shape (N, m), shape (N, M)."""
        columns = [self.inputs.index(name) for name in self.settings.scheduling]
        return self.cells.weights(np.asarray(inputs)[:, columns], self.settings.k_sigma)

    def predict(self, inputs: Array, output: Array) -> Array:
        """Return the one-step prediction of every row from measured rows before it, shape (N,).

        The first rows, before which too little is known, are those measured.

        Args:
            inputs: u, absolute, shape (N, m).
            output: y as measured, absolute, shape (N,).
        """
        n = self.orders.before
        rows = regressors(inputs - self.input_point, output - self.output_point, self.orders)
        shares = self.weights(inputs)[n - 1 : -1]
        predicted = np.einsum("kr,kr->k", rows, shares @ self.parameters)
        return np.concatenate([output[:n], self.output_point + predicted])

    def at_rest(self, inputs: Array) -> Array:
        """Return the output at rest at inputs of shape (N, m), shape (N,).

        Raises:
            IdentificationError: A blend has no rest: a pole of exactly 1.
        """
        blend = self.weights(inputs) @ self.parameters
        stiffness = 1.0 - blend[:, : self.orders.past_outputs].sum(axis=1)
        if np.any(stiffness == 0.0):
            mend = "Give other orders, or data with less drift"
            raise IdentificationError.of("ARX network", "has no rest: a pole of 1", mend)
        return np.asarray(self.output_point + self._drive_at_rest(blend, inputs) / stiffness)

    def free_run(self, inputs: Array) -> Array:
        """Return the simulated output, from rest at the first inputs, shape (N,).

        It may run away: then it ends in infinities and NaN.

        Args:
            inputs: u, absolute, shape (N, m).

        Raises:
            IdentificationError: There is no rest at the first inputs.
        """
        n, na = self.orders.before, self.orders.past_outputs
        known = np.vstack([np.repeat(inputs[:1], n, axis=0), inputs])
        blend = self.weights(known)[n - 1 : -1] @ self.parameters
        rows = regressors(known - self.input_point, np.zeros(len(known)), self.orders)
        drive = np.einsum("kr,kr->k", rows[:, na:], blend[:, na:])
        backwards = np.ascontiguousarray(blend[:, na - 1 :: -1] if na else blend[:, :0])
        y = np.full(len(known), self.at_rest(inputs[:1])[0] - self.output_point)
        with np.errstate(over="ignore", invalid="ignore"):
            for k, (a, v) in enumerate(zip(backwards, drive, strict=True), start=n):
                y[k] = a @ y[k - na : k] + v
        return np.asarray(self.output_point + y[n:])

    def poles(self, index: int) -> NDArray[np.complex128]:
        """Return the poles of a local model in the z plane, shape (na,)."""
        return poles_of(self.parameters[index, : self.orders.past_outputs])

    def spectral_radii(self, inputs: Array) -> Array:
        """Return the largest |pole| of the frozen blend at inputs of shape (N, m), shape (N,)."""
        blends = (self.weights(inputs) @ self.parameters)[:, : self.orders.past_outputs]
        return np.array([np.abs(poles_of(one)).max() for one in blends])

    def _drive_at_rest(self, blend: Array, inputs: Array) -> Array:
        deviation = inputs - self.input_point
        total = blend[:, -1].copy()
        for index in range(self.orders.inputs):
            total += blend[:, self.orders.of_input(index)].sum(axis=1) * deviation[:, index]
        return total


def poles_of(coefficients: Array) -> NDArray[np.complex128]:
    """Return the zeros of z^na - a_1 z^(na-1) - ... - a_na, shape (na,)."""
    return np.linalg.eigvals(companion(coefficients)).astype(np.complex128)


def companion(coefficients: Array) -> Array:
    """Return the matrix with the coefficients as first row, and ones below the diagonal, shape (n, n)."""
    matrix = np.eye(len(coefficients), k=-1)
    matrix[0] = coefficients
    return matrix


def identify(
    data: Sequence[DataSet], inputs: Sequence[str], output: str, settings: LolimotSettings
) -> ArxNetwork:
    """Return the network that LOLIMOT finds (Nelles 2001; thesis section 3.2.4).

    Args:
        data: Training data, one or several experiments of one sample time.
        inputs: Names of the m inputs.
        output: Name of the output.
        settings: Orders and tree.

    Raises:
        DataError: Columns are missing, too few rows, inputs or output that do not move, other sample times.
        IdentificationError: A scheduling signal is no input.
    """
    orders = Orders(settings.past_outputs, settings.past_inputs, len(inputs), settings.delay)
    _check(data, inputs, output, settings, orders)
    u = [one.matrix(inputs)[:: settings.every] for one in data]
    y = [one.column(output)[:: settings.every] for one in data]
    input_point, output_point = np.vstack(u).mean(axis=0), float(np.concatenate(y).mean())
    pairs = list(zip(u, y, strict=True))
    rows = np.vstack([regressors(a - input_point, b - output_point, orders) for a, b in pairs])
    target = np.concatenate([b[orders.before :] - output_point for b in y])
    places = [list(inputs).index(name) for name in settings.scheduling]
    schedule = np.vstack([a[orders.before - 1 : -1, places] for a in u])
    turned = differences(orders)
    limits = np.array(list(settings.scheduling.values()))
    grower = Grower(rows @ turned.T, target, schedule, settings.k_sigma)
    cells, parameters, growth = grower.grow(
        limits[:, 0], limits[:, 1], settings.most_models, settings.least_gain
    )
    return ArxNetwork(
        settings,
        tuple(inputs),
        output,
        data[0].sample_time * settings.every,
        orders,
        cells,
        parameters @ turned,
        input_point,
        output_point,
        growth,
    )


def with_settings(network: ArxNetwork, settings: LolimotSettings) -> ArxNetwork:
    """Return the network for another state-space form, origin or blending."""
    return replace(network, settings=settings)


def _check(
    data: Sequence[DataSet], inputs: Sequence[str], output: str, settings: LolimotSettings, orders: Orders
) -> None:
    unknown = [name for name in settings.scheduling if name not in inputs]
    if unknown:
        what = f"{', '.join(unknown)} is no input"
        raise IdentificationError.of("LOLIMOT, scheduling", what, f"Name some of {', '.join(inputs)}")
    if not data:
        raise DataError.of("LOLIMOT", "there are no training data", "Give at least one data set")
    found: list[Problem] = []
    for one in data:
        found += one.scale_problems(data[0].sample_time, data[0].names, data[0].units)
        signals = one.matrix([*inputs, output])[:: settings.every]
        place = f"data set {one.name!r}"
        needed = orders.before + orders.size
        if len(signals) < needed:
            what = f"has {len(signals)} rows at every {settings.every}, {needed} are needed for these orders"
            found.append(Problem(place, what, "Record longer, or choose lower orders"))
            continue
        for name, varies in zip([*inputs, output], moves(signals), strict=True):
            if not varies:
                what = f"has {name!r} constant: nothing tells what it does"
                found.append(Problem(place, what, "Excite it, or leave it out"))
        for name, (low, high) in settings.scheduling.items():
            column = one.column(name)[:: settings.every]
            count = int(((column >= low) & (column <= high)).sum())
            if count < orders.size:
                what = (
                    f"has {count} rows in the range {low:g} .. {high:g} of {name!r}, {orders.size} are needed"
                )
                found.append(Problem(place, what, "Give the range that the data go through"))
    if found:
        raise DataError(found)

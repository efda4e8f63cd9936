"""The kernel against NumPy: blended matrices, the Gaussians of thesis eq. 3.11 as printed, linalg.solve."""

from __future__ import annotations

from itertools import pairwise

import networks
import numpy as np
import pytest

import tolerances
from fmu_builder.kernel import simulate, static_outputs, validities
from fmu_builder.parameter_set import LocalLinearModel, ParameterSet

Array = networks.Array


def interpolated(positions: Array, values: Array, x: float) -> Array:
    """np.interp per column, continued by the end segments."""
    k = int(np.clip(np.searchsorted(positions, x) - 1, 0, len(positions) - 2))
    slope = (values[k + 1] - values[k]) / (positions[k + 1] - positions[k])
    return np.asarray(values[k] + slope * (x - positions[k]))


class MatrixNetwork:
    """The equations as matrix products over stacked models."""

    def __init__(self, parameter_set: ParameterSet) -> None:
        self.set, self.kind = parameter_set, parameter_set.offsets.kind
        self.local = parameter_set.blending == "output"
        table = parameter_set.node_table
        models = parameter_set.local_models if table is None or self.local else table.models
        self.m = {name: self.stack(models, name) for name in ("A", "B", "C", "D", "g", "x0", "u0", "y0")}
        self.s = parameter_set.scheduling_index
        self.u_op = np.array([signal.operating_point for signal in parameter_set.inputs])
        self.y_op = np.array([signal.operating_point for signal in parameter_set.outputs])

    @staticmethod
    def stack(models: tuple[LocalLinearModel, ...], name: str) -> Array | None:
        values = [getattr(model, name) for model in models]
        return None if values[0] is None else np.array(values)

    def weights(self, position: float) -> tuple[Array, Array]:
        """Validities, and the weights of the stacked models."""
        partition, table = self.set.partition, self.set.node_table
        r = float(np.clip(position, *partition.range))
        if table is None:
            sigma = partition.k_sigma * np.array(partition.spreads)  # type: ignore[operator]
            mu = np.exp(-0.5 * ((r - np.array(partition.centres)) / sigma) ** 2)
            return mu / mu.sum(), mu / mu.sum()
        hats = np.array([np.interp(r, table.positions, row) for row in np.eye(len(table.positions))])
        phi = hats @ np.array(table.weights)
        return phi, (phi if self.local else hats)

    def mixed(self, name: str, w: Array) -> Array:
        stacked = self.m[name]
        return stacked if self.local else np.tensordot(w, stacked, 1)[None]  # type: ignore[arg-type,index]

    def parts(self, w: Array, u: Array, low_pass: float) -> tuple[Array, Array, Array]:
        """A [.., n, n], x0 [.., n] and B times the deviation [.., n] of every model that has a state."""
        A, B = self.mixed("A", w), self.mixed("B", w)
        x0 = self.mixed("x0", w) if self.kind == "affine" else np.zeros(A.shape[:2])
        u0 = self.mixed("u0", w) if self.kind == "affine" else np.tile(self.u_op, (len(A), 1))
        deviation = u - u0
        if self.kind == "low_pass":
            deviation[:, self.s] = u[self.s] - low_pass
        if self.kind == "scheduled_equilibrium":
            deviation[:, self.s] = 0.0
        return A, x0, np.einsum("kij,kj->ki", B, deviation)

    def run(self, inputs: Array) -> Array:
        low_pass = last = inputs[0, self.s]
        phi, w = self.weights(low_pass)
        A, x0, drive = self.parts(w, inputs[0], low_pass)
        right = drive - np.einsum("kij,kj->ki", A, x0)
        x = np.linalg.solve(np.eye(A.shape[-1]) - A, right[..., None])[..., 0]
        g = self.mixed("g", w) if self.kind == "scheduled_equilibrium" else None
        rows = [self.outputs(x, phi, w, low_pass, last, inputs[0])]
        for u, following in pairwise(inputs):
            change, last = u[self.s] - last, u[self.s]
            if self.kind == "low_pass":
                frequency = self.set.offsets.corner_frequency or 0.0
                low_pass += -np.expm1(-2.0 * np.pi * frequency * self.set.sample_time) * (last - low_pass)
            phi, w = self.weights(low_pass if self.kind == "low_pass" else last)
            if g is not None:
                before, g = g, self.mixed("g", w)
                x = x - 0.5 * (g + before) * change
            A, x0, drive = self.parts(w, u, low_pass)
            x = np.einsum("kij,kj->ki", A, x - x0) + drive
            rows.append(self.outputs(x, phi, w, low_pass, last, following))
        return np.array(rows)

    def outputs(self, x: Array, phi: Array, w: Array, low_pass: float, last: float, u: Array) -> Array:
        C, D = self.mixed("C", w), self.mixed("D", w)
        each = np.einsum("kij,kj->ki", C, x)
        deviation = np.tile(u - self.u_op, (len(C), 1))
        if self.kind == "affine":
            each = np.einsum("kij,kj->ki", C, x - self.mixed("x0", w)) + self.mixed("y0", w)
            deviation = u - self.mixed("u0", w)
        if self.kind == "low_pass":
            deviation[:, self.s] = u[self.s] - low_pass
        each = each + np.einsum("kij,kj->ki", D, deviation)
        y = phi @ each if self.local else each[0]
        static_map = self.set.offsets.static_map
        if static_map is not None:
            position = low_pass if self.kind == "low_pass" else last
            y = y + interpolated(np.array(static_map.positions), np.array(static_map.values), position)
        elif self.kind == "none":
            y = y + self.y_op
        return np.array([*y, 50000.0 * (y[2] - u[1]), y[0] + 2.5 * y[1]])


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_matrix_products_agree_with_the_kernel(variant: tuple[str, str, str], feedthrough: bool) -> None:
    parameter_set = networks.network(17, *variant, feedthrough)
    inputs = networks.inputs_of(7, 200, 3)
    expected, found = MatrixNetwork(parameter_set).run(inputs), simulate(parameter_set, inputs)
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected).max(axis=0) <= tolerances.KERNEL_VECTORISED * size).all()


@pytest.mark.parametrize("validity", networks.VALIDITIES)
def test_validities_agree_with_the_formula(validity: str) -> None:
    parameter_set = networks.network(17, validity=validity)
    positions = np.concatenate([np.linspace(0.0, 3.0, 301), [-1e9, 1e9]])
    oracle = MatrixNetwork(parameter_set)
    expected = np.array([oracle.weights(position)[0] for position in positions])
    np.testing.assert_allclose(validities(parameter_set, positions), expected, rtol=0, atol=1e-12)


def test_the_static_map_agrees_with_interpolation_and_goes_on_beyond_its_ends() -> None:
    parameter_set = networks.network(17)
    static_map = parameter_set.offsets.static_map
    assert static_map is not None
    positions, values = np.array(static_map.positions), np.array(static_map.values)
    heights = np.concatenate([np.linspace(-1.0, 4.0, 201), positions])
    expected = np.array([interpolated(positions, values, height) for height in heights])
    found = static_outputs(parameter_set, heights)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(found[-7:], values)
    beyond = static_outputs(parameter_set, [3.0, 4.0, 5.0])
    assert (beyond[1] != beyond[0]).all()

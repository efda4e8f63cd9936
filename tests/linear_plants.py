"""Plants with known equations: what an estimator must find; discretised by expm."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag, expm

from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import ExcitationSettings, operating_point_inputs, random_stream
from identification.local_model import LocalModel

CONTACT_STIFFNESS = 1e5
THREE_MASS_OUTPUTS = ("xi", "xi_dot", "zeta", "zeta_dot")
THREE_MASS_UNITS = ("m", "m/s", "m", "m/s")
_EXCITATION = ExcitationSettings(noise_rms=0.0024)


def zero_order_hold(A: Array, B: Array, sample_time: float) -> tuple[Array, Array]:
    n, m = B.shape
    augmented = np.zeros((n + m, n + m))
    augmented[:n, :n], augmented[:n, n:] = A, B
    both = expm(augmented * sample_time)
    return both[:n, :n], both[:n, n:]


def three_mass(scale: float = 1.0) -> LocalModel:
    """Head, upper and lower frame on springs; modes 3.3 / 12.1 / 22.4 Hz, damping .060 / .050 / .024.

    `scale` multiplies the stiffness between the frames.
    """
    head, upper, lower = 5.609, 8.0, 14.0
    k_head, k_frame, k_ground = 10384.8, scale * 25343.9, 1200.0
    c_head, c_frame, c_ground = 32.0, 25.0, 30.0
    mass = np.diag([head, upper, lower])
    stiffness = np.array(
        [
            [k_head + CONTACT_STIFFNESS, -k_head, 0.0],
            [-k_head, k_head + k_frame, -k_frame],
            [0.0, -k_frame, k_frame + k_ground],
        ]
    )
    damping = np.array(
        [[c_head, -c_head, 0.0], [-c_head, c_head + c_frame, -c_frame], [0.0, -c_frame, c_frame + c_ground]]
    )
    force = np.array([[CONTACT_STIFFNESS, 0.0], [0.0, 0.0], [0.0, 1.0 / 0.3]])
    A = np.block(
        [[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    B = np.vstack([np.zeros((3, 2)), np.linalg.solve(mass, force)])
    C = np.zeros((4, 6))
    C[0, 0] = C[1, 3] = C[2, 1] = C[3, 4] = 1.0
    A, B = zero_order_hold(A, B, 0.001)
    rest = np.array([1.5, 0.0, 1.53, 0.0])
    inputs = ("eta", "M_pa")
    return LocalModel(
        A, B, C, np.zeros((4, 2)), 0.001, inputs, THREE_MASS_OUTPUTS, np.array([1.5, 1310.9]), rest
    )


def asymmetric(feed_through: bool = False) -> LocalModel:
    """3 inputs, 2 outputs, 5 states: modes 2.0 Hz (damping .02) and 7.3 Hz (.015), one real pole; 4 ms."""
    blocks = []
    for frequency, damping in ((2.0, 0.02), (7.3, 0.015)):
        omega = 2.0 * np.pi * frequency
        blocks.append(np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]]))
    blocks.append(np.array([[-9.0]]))
    A = block_diag(*blocks)
    B = np.array(
        [[0.0, 0.0, 0.0], [30.0, -4.0, 11.0], [0.0, 0.0, 0.0], [-70.0, 90.0, 25.0], [2.0, 3.0, -1.0]]
    )
    C = np.array([[1.0, 0.02, -0.4, 0.0, 0.1], [0.3, -0.01, 1.1, 0.03, -0.2]])
    A, B = zero_order_hold(A, B, 0.004)
    D = np.array([[0.0, 0.3, -0.1], [0.0, 0.02, 0.4]]) if feed_through else np.zeros((2, 3))
    names = ("drive", "load", "heat"), ("angle", "speed")
    rest = np.array([0.5, -2.0, 30.0]), np.array([4.0, -7.0])
    return LocalModel(A, B, C, D, 0.004, *names, *rest)


def rest_state(plant: LocalModel, inputs: Array) -> Array:
    """State at rest for absolute inputs, shape (m,)."""
    drive = plant.B @ (inputs - plant.input_operating_point)
    return np.asarray(np.linalg.solve(np.eye(plant.order) - plant.A, drive))


def row_by_row(plant: LocalModel, inputs: Array, start: Array) -> Array:
    """The equations of a local model as they stand, one row after the other."""
    x, rows = start, []
    for u in inputs - plant.input_operating_point:
        rows.append(plant.output_operating_point + plant.C @ x + plant.D @ u)
        x = plant.A @ x + plant.B @ u
    return np.array(rows)


def recorded(plant: LocalModel, inputs: DataSet, units: tuple[str, ...]) -> DataSet:
    """The data set of a plant that starts at rest."""
    values = inputs.matrix(plant.inputs)
    outputs = plant.simulate(values, rest_state(plant, values[0]))
    return inputs.with_columns(plant.outputs, units, outputs)


def three_mass_data(seed: int, height: float = 1.5, duration: float = 12.0, scale: float = 1.0) -> DataSet:
    inputs = operating_point_inputs(height, seed, (round(100 * height),), duration, _EXCITATION)
    return recorded(three_mass(scale), inputs, THREE_MASS_UNITS)


def asymmetric_data(seed: int, rows: int = 6000, feed_through: bool = False) -> DataSet:
    plant = asymmetric(feed_through)
    values = plant.input_operating_point + random_stream(seed).standard_normal((rows, 3)) * [0.1, 5.0, 2.0]
    inputs = DataSet("asymmetric", plant.sample_time, plant.inputs, ("N", "N.m", "m"), values)
    return recorded(plant, inputs, ("rad", "rad/s"))


def contact_force(outputs: Array, eta: Array) -> Array:
    return CONTACT_STIFFNESS * (outputs[:, 0] - eta)

"""Random three-mass plants on the scale of the thesis's Table 4.3, and data of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification import n4sid
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, with_measurement_noise
from identification.static_map import StaticMap
from identification.subspace import SubspaceSettings
from identification.surrogate import SIGNALS, Head, SurrogateResult, SurrogateSettings, identify
from identification.surrogate.certainty import Certainty, certainty
from identification.surrogate.output_error import OutputErrorSettings, fit_output_error
from identification.surrogate.problem import NetworkParameters
from identification.surrogate.structure import STRUCTURES

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN = STRUCTURES["chain8"]
HEIGHT, TORQUE = 1.5, 1310.9
NOISE = {"xi": 1e-5, "xi_dot": 1e-3, "zeta": 1e-5, "zeta_dot": 1e-3}
OUTPUTS = tuple(NOISE)
UNITS = ("m", "m/s", "m", "m/s")
_SCALE = np.array([15.5, 35.0, 210.0, 8000.0])
_HEAVIEST = 42.0
TIGHT = OutputErrorSettings(iterations=300, tolerance=1e-10)


def random_chain(seed: int) -> Array:
    """A chain8: masses and stiffnesses log-uniform within a factor of three of Table 4.3's scale.

    Each damper of the lower framework has a damping ratio of 0.02 to 0.2 with the stiffness and the mass
    beside it. Masses near their bound of 50 kg are drawn again: at a bound there is no standard error. b_H
    stays away from zero, where nothing is relative.
    """
    generator = np.random.default_rng(seed)
    m_H = m_M = _HEAVIEST
    while max(m_H, m_M) >= _HEAVIEST:
        m_H, m_M, k_L, k_W = _SCALE * 3.0 ** generator.uniform(-1.0, 1.0, 4)
    upper, lower = generator.uniform(0.02, 0.2, 2)
    c_L, c_W = 2.0 * upper * np.sqrt(k_L * m_H), 2.0 * lower * np.sqrt(k_W * m_M)
    b_H = generator.choice([-1.0, 1.0]) * generator.uniform(0.05, 0.5)
    return np.array([m_H, m_M, k_L, c_L, generator.uniform(1.0, 5.0), b_H, k_W, c_W])


def gain(theta: Array) -> Array:
    """Rest of xi, xi_dot, zeta, zeta_dot over eta and M_pa - 1310.9 N.m, (4, 2)."""
    A, B = CHAIN.continuous(theta, HEAD)
    return np.asarray(-np.linalg.solve(A, B)[:4])


def static_map(theta: Array) -> StaticMap:
    """Where the plant rests over the height."""
    positions = np.linspace(0.5, 2.5, 5)
    return StaticMap(positions, np.outer(positions, gain(theta)[:, 0]), OUTPUTS)


def recorded(theta: Array, seed: int, duration: float, noise_seed: int | None = None) -> DataSet:
    """Operating-point data of the plant by the acceptance recipe; forces follow the noisy motion."""
    inputs = operating_point_inputs(HEIGHT, seed, duration=duration)
    dynamics = CHAIN.discretise(theta, HEAD, 1e-3, derivatives=False)
    u = inputs.matrix(("eta", "M_pa")) - [0.0, TORQUE]
    x = np.linalg.solve(np.eye(6) - dynamics.A, dynamics.B @ u[0])
    rows = np.empty((len(u), len(OUTPUTS)))
    for k, row in enumerate(u):
        rows[k] = x[: len(OUTPUTS)]
        x = dynamics.A @ x + dynamics.B @ row
    data = inputs.with_columns(OUTPUTS, UNITS, rows)
    if noise_seed is not None:
        data = with_measurement_noise(data, NOISE, seed, (1, noise_seed))
    xi, xi_dot, zeta, zeta_dot = data.matrix(OUTPUTS).T
    crossbar = HEAD.k_C * (zeta - xi) + HEAD.c_C * (zeta_dot - xi_dot)
    forces = np.column_stack([crossbar, HEAD.k_E * (xi - data.column("eta"))])
    return data.with_columns(SIGNALS[4:], ("N", "N"), forces)


def identified(theta: Array, data: DataSet) -> SurrogateResult:
    """The whole way from data to theta: n4sid, closed form, frequency response, output error.

    The order is given, as it is known of three masses: noise hides weak modes, and an order that is read from
    singular values then leaves them out.
    """
    chosen = n4sid.N4sidSettings(local_models=1, subspace=SubspaceSettings(order=6, block_rows=100))
    local = n4sid.identify([data], chosen, static_map(theta))
    wanted = SurrogateSettings(structure="chain8", output_error=TIGHT, standard_errors=False)
    return identify(local, [data], HEAD, wanted)


@dataclass(frozen=True)
class Trial:
    """What a plant showed.

    Attributes:
        condition: Of its Fisher matrix scaled to unit diagonal.
        clean: Largest relative error of the tuned theta from noise-free data.
        distance: Error over standard error from noisy data, the whole way, (P,).
        ratio: Standard error over scatter, (P,), empty if it was not asked for.
    """

    condition: float
    clean: float
    distance: Array
    ratio: Array


def trial(seed: int, duration: float, noise_seeds: int, sure_seeds: int = 5) -> Trial:
    """Identify a plant without noise, with it, and again and again.

    Args:
        seed: Of the plant and of the excitation.
        duration: Of the data [s].
        noise_seeds: How often the noise is drawn anew for the scatter.
        sure_seeds: Of how many of them the standard errors are taken, as a median.
    """
    theta = random_chain(seed)
    clean = identified(theta, recorded(theta, seed, duration))
    wrong = float(np.max(np.abs(clean.tuned[0] / theta - 1.0)))
    told: list[Certainty] = []
    found = []
    start = NetworkParameters(theta[None])
    for noise_seed in range(noise_seeds):
        problem = clean.problem([recorded(theta, seed, duration, noise_seed)])
        fit = fit_output_error(problem, start, TIGHT)
        found.append(fit.theta[0])
        if noise_seed < sure_seeds:
            told.append(certainty(problem, fit.parameters))
    errors = np.median([one.standard_errors[0] for one in told], axis=0)
    noisy = identified(theta, recorded(theta, seed, duration, noise_seeds))
    distance = np.abs(noisy.tuned[0] - theta) / errors
    ratio = errors / np.std(found, axis=0, ddof=1) if noise_seeds > 1 else np.zeros(0)
    return Trial(told[0].condition, wrong, distance, ratio)

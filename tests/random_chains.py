"""Random three-mass plants on the scale of the thesis's Table 4.3, and data of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from identification import n4sid
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, with_measurement_noise
from identification.static_map import StaticMap
from identification.surrogate import (
    SIGNALS,
    Head,
    OutputErrorProblem,
    SurrogateResult,
    SurrogateSettings,
    identify,
    local_model_settings,
)
from identification.surrogate.certainty import certainty
from identification.surrogate.output_error import fit_output_error
from identification.surrogate.problem import NetworkParameters
from identification.surrogate.structure import STRUCTURES

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN = STRUCTURES["chain8"]
HEIGHT, TORQUE = 1.5, 1310.9
NOISE = {"xi": 1e-5, "xi_dot": 1e-3, "zeta": 1e-5, "zeta_dot": 1e-3}
OUTPUTS = tuple(NOISE)
UNITS = ("m", "m/s", "m", "m/s")
SCALE = np.array([15.5, 35.0, 210.0, 8000.0])
"""m_H, m_M [kg], k_L, k_W [N/m]: means over the four local models of Table 4.3."""


def random_chain(seed: int) -> Array:
    """A chain8: masses and stiffnesses log-uniform within a factor of three of Table 4.3's scale.

    Each damper of the lower framework has a damping ratio of 0.02 to 0.2 with the stiffness and the mass
    beside it. b_H stays away from zero, where nothing is relative.
    """
    generator = np.random.default_rng(seed)
    m_H, m_M, k_L, k_W = SCALE * 3.0 ** generator.uniform(-1.0, 1.0, 4)
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


def recorded(theta: Array, seed: int, duration: float) -> DataSet:
    """Operating-point data of the plant by the acceptance recipe, without noise."""
    inputs = operating_point_inputs(HEIGHT, seed, duration=duration)
    dynamics = CHAIN.discretise(theta, HEAD, 1e-3, derivatives=False)
    u = inputs.matrix(("eta", "M_pa")) - [0.0, TORQUE]
    x = np.linalg.solve(np.eye(6) - dynamics.A, dynamics.B @ u[0])
    rows = np.empty((len(u), len(OUTPUTS)))
    for k, row in enumerate(u):
        rows[k] = x[: len(OUTPUTS)]
        x = dynamics.A @ x + dynamics.B @ row
    return with_forces(inputs.with_columns(OUTPUTS, UNITS, rows))


def with_forces(data: DataSet) -> DataSet:
    """The data with the head's forces, which follow the motion as measured."""
    xi, xi_dot, zeta, zeta_dot = data.matrix(OUTPUTS).T
    crossbar = HEAD.k_C * (zeta - xi) + HEAD.c_C * (zeta_dot - xi_dot)
    forces = np.column_stack([crossbar, HEAD.k_E * (xi - data.column("eta"))])
    return data.with_columns(SIGNALS[4:], ("N", "N"), forces)


def noisy(data: DataSet, seed: int, noise_seed: int) -> DataSet:
    """Data of `recorded` as measured with noise."""
    return with_forces(
        with_measurement_noise(data.select(("eta", "M_pa", *OUTPUTS)), NOISE, seed, (1, noise_seed))
    )


def identified(theta: Array, data: DataSet, standard_errors: bool = False) -> SurrogateResult:
    """The whole way from data to theta as a user has it: nothing is set, nothing of theta is known.

    Local model, closed form, frequency response, output error. The static map is that of the plant: an LTI
    plant at one height shows no other, and statics are no part of theta.
    """
    chosen = local_model_settings(n4sid.N4sidSettings(local_models=1))
    local = n4sid.identify([data], chosen, static_map(theta))
    return identify(local, [data], HEAD, SurrogateSettings(standard_errors=standard_errors))


def condition(problem: OutputErrorProblem, theta: Array) -> float:
    """Of the Fisher matrix of a plant scaled to unit diagonal."""
    return certainty(problem, NetworkParameters(theta[None])).condition


@dataclass(frozen=True)
class Trial:
    """What a plant showed.

    Attributes:
        seed: Of the plant.
        condition: Of its Fisher matrix scaled to unit diagonal.
        clean: Largest relative error of the tuned theta from noise-free data.
        order: Choice of the order from noisy data, in words.
        distance: Error over the standard error told beside it, from noisy data, (P,).
        ratio: Standard error over scatter, (P,), empty if it was not asked for.
    """

    seed: int
    condition: float
    clean: float = np.nan
    order: str = ""
    distance: Array = field(default_factory=lambda: np.zeros(0))
    ratio: Array = field(default_factory=lambda: np.zeros(0))


def trial(
    seed: int,
    duration: float,
    noise_seeds: int,
    sure_seeds: int = 5,
    largest_condition: float = np.inf,
    whole: bool = False,
) -> Trial:
    """Identify a plant without noise, with it, and again and again.

    Args:
        seed: Of the plant and of the excitation.
        duration: Of the data [s].
        noise_seeds: How often the noise is drawn anew for the scatter.
        sure_seeds: Of how many of them the standard errors are taken, as a median.
        largest_condition: Beyond it the plant is refused: nothing but its condition is told.
        whole: The whole way for every draw; otherwise output error from the physical theta of the first.
    """
    theta = random_chain(seed)
    data = recorded(theta, seed, duration)
    first = noisy(data, seed, noise_seeds)
    found = identified(theta, first, standard_errors=True)
    worst = condition(found.problem([first]), theta)
    if worst > largest_condition:
        return Trial(seed, worst)
    clean = identified(theta, data)
    wrong = float(np.max(np.abs(clean.tuned[0] / theta - 1.0)))
    settings = found.settings.output_error
    thetas, told = [], []
    for noise_seed in range(noise_seeds):
        again = noisy(data, seed, noise_seed)
        problem = found.problem([again])
        if whole:
            parameters = identified(theta, again).tuned_parameters
        else:
            parameters = fit_output_error(problem, found.physical_parameters, settings).parameters
        thetas.append(parameters.theta[0])
        if noise_seed < sure_seeds:
            told.append(certainty(problem, parameters).standard_errors[0])
    ratio = np.zeros(0)
    if noise_seeds > 1:
        ratio = np.median(told, axis=0) / np.std(thetas, axis=0, ddof=1)
    distance = np.abs(found.tuned[0] - theta) / found.standard_errors("tuned")[0]
    choices = found.local.models[0].diagnostics["choices"]
    order = next(f"{one['value']}: {one['reason']}" for one in choices if one["name"] == "order")
    return Trial(seed, worst, wrong, order, distance, ratio)

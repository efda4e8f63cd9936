"""Theta of a surrogate from the frequency response of a local black-box model.

A search in the frequency domain meets far fewer local optima than the output error itself, so it gives the
start of the output error, and because statics do not disturb it, the physical values of the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field
from scipy.signal import welch

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.local_model import LocalModel
from identification.surrogate.least_squares import Minimum, NormalEquations, minimise
from identification.surrogate.structure import (
    INPUT_NAMES,
    OUTPUT_MATRIX,
    OUTPUT_NAMES,
    Head,
    LocalDynamics,
    Structure,
)

ComplexArray = npt.NDArray[np.complex128]

REASONED_START: Mapping[str, float] = {
    "m_H": 8.0,  # bars reduced to the head: the upper arm near the crossbar, the rest below
    "m_M": 20.0,
    "k_L": 25000.0,  # an elastic upper arm: the second mode near 12 Hz
    "c_L": 40.0,  # a few percent of damping, here and at the wall
    "r_M": 0.4,
    "k_W": 500.0,  # a frame in nearly neutral balance
    "c_W": 40.0,
}
PUBLISHED_START: Mapping[str, float] = {  # mean of the four columns of thesis Table 4.3, rounded
    "m_H": 15.5,
    "m_M": 35.0,
    "k_L": 210.0,
    "c_L": 41.0,
    "r_M": 0.15,
    "k_W": 8000.0,
    "c_W": 2501.0,
}


class FrequencyResponseSettings(BaseModel):
    """How theta is fitted to a frequency response.

    Attributes:
        lowest: Lowest frequency, Hz.
        highest: Highest frequency, Hz.
        count: Frequencies, equally spaced in log.
        random_starts: Starts drawn log-uniformly within the bounds, beside the reasoned and the published
            one.
        seed: Seed of the random starts.
        iterations: Most steps from one start.
        agreement: Relative difference of the cost up to which two starts count as having found the same
            optimum.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lowest: float = Field(0.4, gt=0.0)
    highest: float = Field(40.0, gt=0.0)
    count: int = Field(60, ge=8)
    random_starts: int = Field(8, ge=0)
    seed: int = 0
    iterations: int = Field(200, ge=1)
    agreement: float = Field(1e-3, gt=0.0)

    def frequencies(self) -> Array:
        """Return the frequencies, Hz, ascending."""
        return np.geomspace(self.lowest, self.highest, self.count)


@dataclass(frozen=True)
class FrequencyResponseFit:
    """Theta of one local model from its frequency response.

    Attributes:
        theta: Parameters, (P,), in the order of the structure.
        relative_error: Weighted norm of the difference over that of the response fitted to.
        at_bound: Parameters at a bound, with `lower` or `upper`.
        best_start: Name of the start that was best: `reasoned`, `published` or `random K`.
        starts: How many starts were made.
        agreed: How many of them ended at the same cost.
        costs: Final cost of every start, in their order.
    """

    theta: Array
    relative_error: float
    at_bound: Mapping[str, str]
    best_start: str
    starts: int
    agreed: int
    costs: tuple[float, ...]


def local_response(model: LocalModel, frequencies: Array) -> ComplexArray:
    """Return the response from eta, M_pa to xi, xi_dot, zeta, zeta_dot of a local model, by name.

    Raises:
        IdentificationError: The model lacks one of these signals.
    """
    missing = [name for name in OUTPUT_NAMES if name not in model.outputs]
    missing += [name for name in INPUT_NAMES if name not in model.inputs]
    if missing:
        what = f"lacks the signals {', '.join(missing)}"
        raise IdentificationError.of("local model", what, "Identify it with the pantograph's signals")
    rows = [model.outputs.index(name) for name in OUTPUT_NAMES]
    columns = [model.inputs.index(name) for name in INPUT_NAMES]
    response: ComplexArray = model.frequency_response(frequencies)[:, rows][:, :, columns]
    return response


def input_spectrum(inputs: Array, sample_time: float, frequencies: Array) -> Array:
    """Return the power spectral density of each input, (F, inputs), from their samples (N, inputs).

    Welch's method over segments of 4 s with the linear trend taken out, so that the slow travel of a
    whole-range experiment does not count as excitation.
    """
    length = min(len(inputs), round(4.0 / sample_time))
    grid, density = welch(inputs, 1.0 / sample_time, nperseg=length, detrend="linear", axis=0)
    columns = [np.interp(frequencies, grid[1:], column) for column in density[1:].T]
    return np.stack(columns, axis=-1)


def response_weights(response: ComplexArray, spectrum: Array, frequencies: Array) -> Array:
    """Return weights (F, outputs, inputs) for the difference of two responses.

    |U_j(f)| sqrt(f) / std(y_i): what an error does to output i under this excitation, relative to the
    output; the root of f makes frequencies equally spaced in log count like equally spaced ones.

    Args:
        response: G, (F, outputs, inputs).
        spectrum: Power spectral density of the inputs, (F, inputs).
        frequencies: Hz, equally spaced in log.
    """
    power = np.einsum("fij,fj,f->i", np.abs(response) ** 2, spectrum, frequencies)
    weights: Array = np.sqrt(spectrum * frequencies[:, None])[:, None, :] / np.sqrt(power)[None, :, None]
    return weights


def fit_frequency_response(
    response: ComplexArray,
    weights: Array,
    structure: Structure,
    head: Head,
    sample_time: float,
    settings: FrequencyResponseSettings,
    extra_starts: Mapping[str, Array] | None = None,
) -> FrequencyResponseFit:
    """Fit theta to a frequency response by bounded least squares from several starts.

    Args:
        response: Response to reproduce at `settings.frequencies()`, (F, 4, 2).
        weights: Weight of each entry, (F, 4, 2).
        structure: Which chain.
        head: The collector head.
        sample_time: Sample time of the discrete models, s.
        settings: Frequencies and starts.
        extra_starts: Further starts by name, each theta (P,).

    Raises:
        IdentificationError: No start leads anywhere finite.
    """
    problem = _ResponseProblem(response, weights, structure, head, sample_time, settings.frequencies())
    starts = _starts(structure, head, settings) | dict(extra_starts or {})
    minima: dict[str, Minimum] = {}
    for name, theta in starts.items():
        minima[name] = minimise(
            problem.cost,
            problem.normal_equations,
            structure.to_search(theta),
            structure.bounds,
            settings.iterations,
            tolerance=1e-7,
            largest_step=1.5,
        )
    finite = [name for name, minimum in minima.items() if np.isfinite(minimum.cost)]
    if not finite:
        what = "no start of the frequency-response fit gives a finite cost"
        raise IdentificationError.of(structure.name, what, "Check the local model and the excitation")
    best = min(finite, key=lambda name: minima[name].cost)
    lowest = minima[best].cost
    within = lowest * (1.0 + settings.agreement) + 1e-12 * problem.size
    theta = structure.from_search(minima[best].x)
    return FrequencyResponseFit(
        theta=theta,
        relative_error=float(np.sqrt(lowest / problem.size)),
        at_bound=structure.at_bound(theta),
        best_start=best,
        starts=len(starts),
        agreed=sum(minima[name].cost <= within for name in finite),
        costs=tuple(minimum.cost for minimum in minima.values()),
    )


def _starts(structure: Structure, head: Head, settings: FrequencyResponseSettings) -> dict[str, Array]:
    """Return the starts by name."""
    known = {"m_C": head.m_C, "k_C": head.k_C, "c_C": head.c_C}
    starts: dict[str, Array] = {}
    for name, values in (("reasoned", REASONED_START), ("published", PUBLISHED_START)):
        given = {**values, **known, "b_M": 1.0 / values["r_M"]}
        starts[name] = np.array([given.get(parameter, 0.0) for parameter in structure.names])
    generator = np.random.default_rng(settings.seed)
    lower, upper = structure.bounds
    for index in range(settings.random_starts):
        starts[f"random {index + 1}"] = structure.from_search(generator.uniform(lower, upper))
    return starts


@dataclass(frozen=True)
class _ResponseProblem:
    """Weighted difference of two frequency responses as a function of the search coordinates."""

    response: ComplexArray
    weights: Array
    structure: Structure
    head: Head
    sample_time: float
    frequencies: Array

    @property
    def size(self) -> float:
        """Weighted sum of squares of the response fitted to."""
        return float(np.sum(np.abs(self.weights * self.response) ** 2))

    def _resolvent(self, dynamics: LocalDynamics) -> ComplexArray:
        z = np.exp(2j * np.pi * self.frequencies * self.sample_time)
        inverse: ComplexArray = np.linalg.inv(z[:, None, None] * np.eye(dynamics.A.shape[0]) - dynamics.A)
        return inverse

    def _residual(self, inverse: ComplexArray, dynamics: LocalDynamics) -> ComplexArray:
        modelled = OUTPUT_MATRIX @ inverse @ dynamics.B
        residual: ComplexArray = self.weights * (self.response - modelled)
        return residual

    def cost(self, search: Array) -> float:
        """Return the weighted sum of squares."""
        theta = self.structure.from_search(search)
        dynamics = self.structure.discretise(theta, self.head, self.sample_time, derivatives=False)
        return float(np.sum(np.abs(self._residual(self._resolvent(dynamics), dynamics)) ** 2))

    def normal_equations(self, search: Array) -> NormalEquations:
        """Return cost, J'r and J'J; dG = C (zI - A)^-1 (dA (zI - A)^-1 B + dB)."""
        theta = self.structure.from_search(search)
        dynamics = self.structure.discretise(theta, self.head, self.sample_time)
        inverse = self._resolvent(dynamics)
        state = inverse @ dynamics.B
        slopes = (OUTPUT_MATRIX @ inverse)[None] @ (dynamics.dA[:, None] @ state[None] + dynamics.dB[:, None])
        slopes = slopes * self.weights * self.structure.slope(theta)[:, None, None, None]
        residual = self._residual(inverse, dynamics).ravel()
        jacobian = slopes.reshape(len(theta), -1)
        gradient = np.real(jacobian.conj() @ residual)
        gram = np.real(jacobian.conj() @ jacobian.T)
        return NormalEquations(float(np.sum(np.abs(residual) ** 2)), gradient, gram)

"""Theta of a surrogate from the frequency response of a local black-box model.

A search in the frequency domain meets far fewer local optima than the output error itself, so it gives the
start of the output error, and because statics do not disturb it, the physical values of the parameters. It
begins at a closed-form solution; random starts are drawn only where that one fails, and the result says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.signal import welch

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.local_model import LocalModel
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_MATRIX, OUTPUT_NAMES, Head, LocalDynamics
from identification.surrogate.closed_form import closed_forms, continuous_response
from identification.surrogate.least_squares import Minimum, NormalEquations, minimise
from identification.surrogate.structure import Structure

ComplexArray = npt.NDArray[np.complex128]

CLOSED_FORM = "closed form"

_EXPLODED = 1e12
"""Entries of a sampled system matrix beyond which there is no response to speak of."""


class FrequencyResponseSettings(BaseModel):
    """How theta is fitted to a frequency response.

    Attributes:
        lowest: Lowest frequency, Hz.
        highest: Highest frequency, Hz.
        count: Frequencies, equally spaced in log.
        start: `closed form` begins at the closed form nearest to the response; the others and random starts
            follow only where it fails. `random` leaves closed forms out.
        random_starts: Starts drawn within the usual values of the structure's parameters.
        largest_error: Relative error above which the closed form counts as failed.
        seed: Seed of the random starts.
        iterations: Most steps from one start.
        agreement: Relative difference of the cost up to which two starts count as having found the same
            optimum.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lowest: float = Field(0.4, gt=0.0)
    highest: float = Field(40.0, gt=0.0)
    count: int = Field(60, ge=8)
    start: Literal["closed form", "random"] = "closed form"
    random_starts: int = Field(10, ge=0)
    largest_error: float = Field(0.05, gt=0.0)
    seed: int = Field(0, ge=0)
    iterations: int = Field(200, ge=1)
    agreement: float = Field(1e-3, gt=0.0)

    @model_validator(mode="after")
    def _rises(self) -> FrequencyResponseSettings:
        if not self.lowest < self.highest:
            raise ValueError(f"lowest, {self.lowest:g} Hz, is not below highest, {self.highest:g} Hz")
        return self

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
        best_start: Name of the first start that led to the lowest cost: that of an extra start, `closed
            form`, `closed form K` or `random K`. A start that led to a stable chain goes first.
        costs: Final cost of every start, by name.
        agreed: How many of them ended at the lowest cost.
        fallback: Why random starts were needed, empty if they were not.
    """

    theta: Array
    relative_error: float
    at_bound: Mapping[str, str]
    best_start: str
    costs: Mapping[str, float]
    agreed: int
    fallback: str = ""

    @property
    def start(self) -> str:
        """`closed form`, `random`, or the name of an extra start: what led to theta."""
        kinds = ("random", CLOSED_FORM)
        return next((kind for kind in kinds if self.best_start.startswith(kind)), self.best_start)

    @property
    def account(self) -> str:
        """How theta was found, in words."""
        if not self.fallback:
            return self.start
        agreed = f"{self.agreed} of {self.starts} starts agree"
        return f"{self.start}, {agreed}; random starts because {self.fallback}"

    @property
    def starts(self) -> int:
        """How many starts were made."""
        return len(self.costs)


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
    model: LocalModel,
    spectrum: Array,
    structure: Structure,
    head: Head,
    settings: FrequencyResponseSettings,
    extra_starts: Mapping[str, Array] | None = None,
) -> FrequencyResponseFit:
    """Fit theta to the frequency response of a local model by bounded least squares.

    Args:
        model: Local model with the pantograph's signals.
        spectrum: Power spectral density of the inputs at `settings.frequencies()`, (F, 2).
        structure: Which chain.
        head: The collector head.
        settings: Frequencies and starts.
        extra_starts: Further starts by name, each theta (P,).

    Raises:
        IdentificationError: A signal is missing, a frequency is beyond what sampling can show, or no start
            leads anywhere finite.
    """
    frequencies = settings.frequencies()
    if settings.highest * model.sample_time >= 0.5:
        what = f"{settings.highest:g} Hz is not below half the sampling frequency"
        raise IdentificationError.of("frequency_response.highest", what, "Give a lower frequency")
    response = local_response(model, frequencies)
    weights = response_weights(response, spectrum, frequencies)
    problem = _ResponseProblem(response, weights, structure, head, model.sample_time, frequencies)
    starts = {name: structure.to_search(theta) for name, theta in (extra_starts or {}).items()}
    others: list[Array] = []
    if settings.start == CLOSED_FORM:
        others = _closed_forms(problem, model)
        if others:
            starts[CLOSED_FORM] = others[0]
    minima = {name: _searched(problem, start, settings) for name, start in starts.items()}
    fallback = _doubt(problem, minima.get(CLOSED_FORM), settings)
    if fallback:
        for index, start in enumerate(others[1:]):
            minima[f"{CLOSED_FORM} {index + 2}"] = _searched(problem, start, settings)
        generator = np.random.default_rng(settings.seed)
        lower, upper = structure.start_bounds
        for index in range(settings.random_starts):
            start = generator.uniform(lower, upper)
            minima[f"random {index + 1}"] = _searched(problem, start, settings)
    finite = [name for name, minimum in minima.items() if np.isfinite(minimum.cost)]
    if not finite:
        what = "no start of the frequency-response fit gives a finite cost"
        raise IdentificationError.of(structure.name, what, "Check the local model and the excitation")
    finite = [name for name in finite if problem.stable(minima[name].x)] or finite
    lowest = min(minima[name].cost for name in finite)
    within = lowest * (1.0 + settings.agreement) + 1e-12 * problem.size
    best = next(name for name in finite if minima[name].cost <= within)
    theta = structure.from_search(minima[best].x)
    return FrequencyResponseFit(
        theta=theta,
        relative_error=float(np.sqrt(lowest / problem.size)),
        at_bound=structure.at_bound(theta),
        best_start=best,
        costs={name: minimum.cost for name, minimum in minima.items()},
        agreed=sum(minima[name].cost <= within for name in finite),
        fallback=fallback,
    )


def _closed_forms(problem: _ResponseProblem, model: LocalModel) -> list[Array]:
    """Return search coordinates of the closed forms, the best first."""
    continuous = continuous_response(model, problem.frequencies)
    if continuous is None:
        return []
    structure = problem.structure
    found = closed_forms(continuous, problem.frequencies, problem.head, problem.weights)
    starts = [structure.to_search(structure.from_coefficients(one, problem.head)) for one in found]
    if not starts:
        return []
    costs = problem.costs(np.stack(starts))
    return [starts[index] for index in np.argsort(costs, kind="stable")]


def _searched(problem: _ResponseProblem, start: Array, settings: FrequencyResponseSettings) -> Minimum:
    return minimise(
        problem.cost,
        problem.normal_equations,
        start,
        problem.structure.bounds,
        settings.iterations,
        tolerance=1e-7,
        largest_step=1.5,
        relative=problem.structure.linear,
        moved=problem.structure.moved,
    )


def _doubt(problem: _ResponseProblem, found: Minimum | None, settings: FrequencyResponseSettings) -> str:
    """Return why what the closed form led to may not be the best optimum; empty if nothing speaks for it."""
    if settings.start != CLOSED_FORM:
        return "the closed form was not asked for"
    if found is None or not np.isfinite(found.cost):
        return "the closed form finds no chain with positive masses and stiffness"
    error = float(np.sqrt(found.cost / problem.size))
    if error > settings.largest_error:
        return f"the closed form leads to a relative error of {error:.2g}"
    if not problem.stable(found.x):
        return "the closed form leads to an unstable chain"
    held = problem.structure.at_bound(problem.structure.from_search(found.x))
    return f"the closed form leads to a bound of {', '.join(held)}" if held else ""


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
        """Return (z I - A)^-1 at every frequency, (..., F, 6, 6)."""
        z = np.exp(2j * np.pi * self.frequencies * self.sample_time)
        size = dynamics.A.shape[-1]
        inverse: ComplexArray = np.linalg.inv(z[:, None, None] * np.eye(size) - dynamics.A[..., None, :, :])
        return inverse

    def _residual(self, inverse: ComplexArray, dynamics: LocalDynamics) -> ComplexArray:
        modelled = OUTPUT_MATRIX @ inverse @ dynamics.B[..., None, :, :]
        residual: ComplexArray = self.weights * (self.response - modelled)
        return residual

    def costs(self, search: Array) -> Array:
        """Return the weighted sums of squares (...) at search coordinates (..., P), infinite if exploded."""
        theta = self.structure.from_search(search)
        with np.errstate(over="ignore", invalid="ignore"):
            dynamics = self.structure.discretise(theta, self.head, self.sample_time, derivatives=False)
        sound = np.max(np.abs(dynamics.A), axis=(-2, -1)) < _EXPLODED  # false for nan
        dynamics = replace(dynamics, A=np.where(sound[..., None, None], dynamics.A, 0.0))
        with np.errstate(over="ignore", invalid="ignore"):
            residual = self._residual(self._resolvent(dynamics), dynamics)
            total = np.sum(residual.real**2 + residual.imag**2, axis=(-3, -2, -1))
        return np.asarray(np.where(sound, total, np.inf))

    def cost(self, search: Array) -> float:
        """Return the weighted sum of squares at one place (P,)."""
        return float(self.costs(search))

    def stable(self, search: Array) -> bool:
        """Return whether the chain comes to rest."""
        poles = np.linalg.eigvals(self.structure.continuous(self.structure.from_search(search), self.head)[0])
        return bool(poles.real.max() < 0.0)

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

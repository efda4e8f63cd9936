"""Output-error tuning of a blended surrogate over whole-range data (thesis 3.4.5) with exact sensitivities.

The statics are kept out of theta: the network runs in scheduled-equilibrium form, so the static map carries
the resting outputs and theta only what moves about them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from identification.arrays import Array
from identification.surrogate.least_squares import Iteration, NormalEquations, minimise
from identification.surrogate.recursion import BlendedModels, Experiment, Observation, Pass, run
from identification.surrogate.structure import OUTPUT_MATRIX, Head, Structure

SIGNALS = ("xi", "xi_dot", "zeta", "zeta_dot", "F_H", "F_p")
"""The signals of the cost, eq. 3.39, in the order used here."""


class OutputErrorSettings(BaseModel):
    """How theta is tuned by output error.

    Attributes:
        enabled: False leaves theta as the frequency response gives it.
        iterations: Most Levenberg-Marquardt steps.
        tolerance: The search ends when a step lowers the cost by less than this fraction.
        largest_step: Largest change of a parameter in one step, in natural log.
        contact_force_weight: Q_Fp of eq. 3.39.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = True
    iterations: int = Field(30, ge=1)
    tolerance: float = Field(1e-5, gt=0.0)
    largest_step: float = Field(1.5, gt=0.0)
    contact_force_weight: float = Field(1.0, gt=0.0)


@dataclass(frozen=True)
class OutputErrorFit:
    """Where the tuning ended.

    Attributes:
        theta: Parameters, (M, P).
        cost_before: Cost of eq. 3.39 at the start, per sample.
        cost_after: Cost at `theta`, per sample.
        history: Start and accepted steps, cost as a sum over samples.
        converged: False if the iteration limit ended the search.
    """

    theta: Array
    cost_before: float
    cost_after: float
    history: tuple[Iteration, ...]
    converged: bool


def observation_matrix(head: Head) -> Array:
    """Return E, (6, 6): the signals of eq. 3.39 from the state; F_p without its part -k_E eta."""
    force_head = np.array([-head.k_C, -head.c_C, head.k_C, head.c_C, 0.0, 0.0])
    force_contact = np.array([head.k_E, 0.0, 0.0, 0.0, 0.0, 0.0])
    return np.vstack([OUTPUT_MATRIX, force_head, force_contact])


def criterion_weights(deviations: Array, contact_force_weight: float) -> Array:
    """Return the weights of the squared residuals of `SIGNALS`, (6,), after eq. 3.39.

    Q_p, Q_v and Q_f balance magnitudes: each is 1 / s^2 with s the mean of the standard deviations of the
        two signals
    of its kind (the text gives s itself, which would enlarge what is large). The standard deviations are
    those of the deviations from the static map: the slow travel through the whole range says nothing about
        dynamics.

    Args:
        deviations: Measured signals less their static values, (N, 6).
        contact_force_weight: Q_Fp.
    """
    spread = deviations.std(axis=0)
    weights = np.empty(len(SIGNALS))
    for kind in (("xi", "zeta"), ("xi_dot", "zeta_dot"), ("F_H", "F_p")):
        columns = [SIGNALS.index(name) for name in kind]
        weights[columns] = 1.0 / max(float(spread[columns].mean()), 1e-150) ** 2
    weights[SIGNALS.index("F_p")] *= contact_force_weight
    return weights


@dataclass(frozen=True)
class OutputErrorProblem:
    """Cost of eq. 3.39 of a blended surrogate as a function of the parameters of all its local models.

    Attributes:
        structure: Which chain.
        head: The collector head.
        sample_time: Ts, s.
        experiments: Training data.
        observation: Observed signals and weights.
    """

    structure: Structure
    head: Head
    sample_time: float
    experiments: Sequence[Experiment]
    observation: Observation

    @property
    def local_models(self) -> int:
        """Number of local models M."""
        return int(self.experiments[0].blend.shape[1])

    def models(self, theta: Array, slopes: bool) -> BlendedModels:
        """Return the local models of theta (M, P), with derivatives to the search coordinates if `slopes`."""
        local = [self.structure.discretise(row, self.head, self.sample_time, slopes) for row in theta]
        A, B = np.stack([one.A for one in local]), np.stack([one.B[:, 1:] for one in local])
        g = np.stack([one.g for one in local])
        if not slopes:
            return BlendedModels.without_slopes(A, B, g)
        chain = np.stack([self.structure.slope(row) for row in theta])
        dA = np.stack([np.moveaxis(one.dA, 0, -1) for one in local]) * chain[:, None, None, :]
        dB = np.stack([np.moveaxis(one.dB[:, :, 1:], 0, -1) for one in local]) * chain[:, None, None, :]
        dg = np.stack([one.dg.T for one in local]) * chain[:, None, :]
        return BlendedModels(A, B, g, dA, dB, dg)

    def _passes(self, search: Array, sensitivities: bool) -> list[Pass]:
        models = self.models(self.theta(search), sensitivities)
        return [run(models, experiment, self.observation, sensitivities) for experiment in self.experiments]

    def theta(self, search: Array) -> Array:
        """Return theta (M, P) of the search coordinates (M P,)."""
        return self.structure.from_search(search.reshape(self.local_models, -1))

    def cost(self, search: Array) -> float:
        """Return the cost; infinite where the simulation is not."""
        return sum(one.cost for one in self._passes(search, False))

    def normal_equations(self, search: Array) -> NormalEquations:
        """Return cost, J'r and J'J in search coordinates."""
        passes = self._passes(search, True)
        gradient = np.sum([one.gradient for one in passes], axis=0)
        return NormalEquations(
            sum(one.cost for one in passes), gradient, np.sum([one.gram for one in passes], axis=0)
        )

    def simulate(self, theta: Array, experiment: Experiment) -> Array:
        """Return the deviation part of `SIGNALS`, (N, 6), for theta (M, P)."""
        return run(self.models(theta, False), experiment, self.observation, simulate=True).simulated


def fit_output_error(
    problem: OutputErrorProblem, start: Array, settings: OutputErrorSettings
) -> OutputErrorFit:
    """Tune theta by Levenberg-Marquardt within the bounds of the structure.

    Args:
        problem: Cost and derivatives.
        start: First theta, (M, P).
        settings: Limits of the search.

    Returns:
        The fit; its cost is never above that of the start.
    """
    models = problem.local_models
    lower, upper = (np.tile(bound, models) for bound in problem.structure.bounds)
    minimum = minimise(
        problem.cost,
        problem.normal_equations,
        problem.structure.to_search(start).ravel(),
        (lower, upper),
        settings.iterations,
        settings.tolerance,
        settings.largest_step,
    )
    rows = sum(len(experiment.scheduling) for experiment in problem.experiments)
    return OutputErrorFit(
        theta=problem.theta(minimum.x),
        cost_before=minimum.history[0].cost / rows,
        cost_after=minimum.cost / rows,
        history=minimum.history,
        converged=minimum.converged,
    )

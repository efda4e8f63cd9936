"""Output-error tuning of a blended surrogate over whole-range data (thesis 3.4.5) with exact sensitivities.

In scheduled-equilibrium form the statics are kept out of theta: the static map carries the resting outputs
and theta only what moves about them. In affine form (eq. 3.33-3.34) offsets of every local model carry them;
those that are redundant are fixed (`affine`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from identification.arrays import Array
from identification.surrogate.chain import INPUT_NAMES
from identification.surrogate.least_squares import Iteration, minimise
from identification.surrogate.problem import Free, NetworkParameters, OutputErrorProblem

_DAMPING = 1e-6
"""The first one: the search begins near the optimum."""


class OutputErrorSettings(BaseModel):
    """How theta is tuned by output error.

    Attributes:
        enabled: False leaves theta as the frequency response gives it.
        iterations: Most Levenberg-Marquardt steps, of every stage.
        tolerance: The search ends when a step lowers the cost by less than this fraction ...
        precision: ... and the optimum is nearer than this fraction of the standard errors, in the mean square
            over all parameters, as far as the data tell.
        largest_step: Largest change of a parameter in one step, in natural log.
        contact_force_weight: Q_Fp of eq. 3.39.
        stages: Numbers of local models of networks tuned one after the other, each from the one before; the
            last is that of the local black-box models. Empty: only that one.
        single_start: Coefficients by name from which the first stage begins; default: the physical theta.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = True
    iterations: int = Field(30, ge=1)
    tolerance: float = Field(1e-4, gt=0.0)
    precision: float = Field(0.03, gt=0.0)
    largest_step: float = Field(1.5, gt=0.0)
    contact_force_weight: float = Field(1.0, gt=0.0)
    stages: tuple[int, ...] = ()
    single_start: dict[str, float] | None = None


@dataclass(frozen=True)
class OutputErrorFit:
    """Where the tuning ended.

    Attributes:
        parameters: What was found.
        cost_before: Cost of eq. 3.39 at the start, per sample.
        cost_after: Cost at `parameters`, per sample.
        history: Start and accepted steps, cost as a sum over samples.
        converged: False if the iteration limit ended the search.
    """

    parameters: NetworkParameters
    cost_before: float
    cost_after: float
    history: tuple[Iteration, ...]
    converged: bool

    @property
    def theta(self) -> Array:
        """Parameters of the local models, (M, P)."""
        return self.parameters.theta


def fit_output_error(
    problem: OutputErrorProblem,
    start: NetworkParameters,
    settings: OutputErrorSettings,
    free: Free = "all",
) -> OutputErrorFit:
    """Tune by Levenberg-Marquardt within the bounds of the structure.

    Args:
        problem: Cost and derivatives.
        start: Where to begin.
        settings: Limits of the search.
        free: What may move.

    Returns:
        The fit; its cost is never above that of the start.
    """
    first = problem.to_search(start)
    minimum = minimise(
        lambda search: problem.cost(problem.from_search(search, start)),
        lambda search: problem.normal_equations(problem.from_search(search, start), free),
        first,
        box(problem, first, free),
        settings.iterations,
        settings.tolerance,
        settings.largest_step,
        damping=_DAMPING,
        precision=settings.precision,
        relative=problem.linear,
        moved=problem.moved,
    )
    return OutputErrorFit(
        parameters=problem.from_search(minimum.x, start),
        cost_before=minimum.history[0].cost / problem.rows,
        cost_after=minimum.cost / problem.rows,
        history=minimum.history,
        converged=minimum.converged,
    )


def box(problem: OutputErrorProblem, start: Array, free: Free) -> tuple[Array, Array]:
    """Return the bounds of the search vector; what may not move has both of them where it is.

    Args:
        problem: Says which bounds there are.
        start: The search vector at the start.
        free: What may move.
    """
    lower, upper = problem.bounds
    moves = np.ones(start.size, dtype=bool)
    rows = moves[: start.size - problem.schedule_size].reshape(problem.local_models, -1)  # a view
    count = len(problem.structure.parameters)
    if free != "all":
        rows[:, :count] = False
    if free == "schedule":
        rows[:, count:] = False
    if free == "offsets":
        moves[start.size - problem.schedule_size :] = False
    if problem.affine and problem.local_models == 1:  # y0 does the same
        rows[:, count : count + len(INPUT_NAMES)] = False
    inside = np.clip(start, lower, upper)
    return np.where(moves, lower, inside), np.where(moves, upper, inside)

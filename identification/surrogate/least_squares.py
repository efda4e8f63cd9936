"""Levenberg-Marquardt on normal equations within a box, for costs whose Jacobian is too large to store."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from identification.arrays import Array

_SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-15, 1e10


class NormalEquations(NamedTuple):
    """Cost r'r, gradient part J'r and Gauss-Newton matrix J'J of residuals r with J = -d r / d x.

    `scores` holds J'r of stretches of the data that count as independent, (stretches, coordinates); a search
    that has none of them does not know how sure its result is.
    """

    cost: float
    gradient: Array
    gram: Array
    scores: Array | None = None


@dataclass(frozen=True)
class Iteration:
    """One accepted step (the first entry of a history is the start: step 0).

    Attributes:
        cost: Cost after the step.
        damping: Levenberg-Marquardt damping with which it was found.
        step: Largest change of a coordinate.
        active: How many coordinates stood at a bound and were not moved.
        trials: Cost evaluations it took.
    """

    cost: float
    damping: float
    step: float
    active: int
    trials: int


@dataclass(frozen=True)
class Minimum:
    """Where a search ended.

    Attributes:
        x: Coordinates, inside the bounds.
        cost: Cost there.
        history: Start and accepted steps.
        converged: False if the iteration limit ended the search.
    """

    x: Array
    cost: float
    history: tuple[Iteration, ...]
    converged: bool


def minimise(
    cost: Callable[[Array], float],
    normal_equations: Callable[[Array], NormalEquations],
    start: Array,
    bounds: tuple[Array, Array],
    iterations: int,
    tolerance: float,
    largest_step: float,
    *,
    damping: float = 1e-3,
    precision: float = np.inf,
    relative: Array | float = 0.0,
    moved: Callable[[Array, Array], Array] = np.add,
) -> Minimum:
    """Minimise a sum of squares within a box.

    A coordinate that stands at a bound and whose gradient points outwards is left out of the step (active
    set); steps are cut at `largest_step` per coordinate and clipped to the box. Damping is Marquardt's: a
    multiple of the diagonal of J'J, changed by gain ratio (Nielsen 1999).

    Args:
        cost: Cost at x, infinite (or not a number) where it cannot be computed.
        normal_equations: The same with J'r and J'J.
        start: First coordinates; moved into the box.
        bounds: Lower and upper bounds.
        iterations: Most accepted steps.
        tolerance: Ends the search when a step lowers the cost by less than this fraction, or moves less than
            a thousandth of this.
        largest_step: Largest change of a coordinate in one step.
        damping: The first one. Far from the optimum a small one costs trials; near it a large one costs steps
            where the problem is badly conditioned.
        precision: The search does not end by the cost before the optimum is nearer than this fraction of the
            standard errors, where `NormalEquations` have scores.
        relative: Share of its own size by which a coordinate may move beyond `largest_step`, times that.
        moved: Coordinates after a step that is tangent to a curve; default a straight line.
    """
    x = np.clip(start, *bounds)
    here = normal_equations(x)
    history = [Iteration(here.cost, 0.0, 0.0, 0, 1)]
    growth = 2.0
    while len(history) <= iterations and np.isfinite(here.cost) and here.cost > 0.0:
        free = _free(x, here.gradient, bounds)
        trials, accepted, promised = 0, False, 0.0
        while not accepted and damping <= _LARGEST_DAMPING and bool(free.any()):
            step = _step(here, free, damping, largest_step * np.maximum(1.0, relative * np.abs(x)))
            move = np.clip(x + step, *bounds) - x
            candidate, trials = np.clip(moved(x, move), *bounds), trials + 1
            value = cost(candidate)
            promised = float(2.0 * here.gradient @ move - move @ here.gram @ move)
            accepted = bool(np.isfinite(value)) and value < here.cost
            gain = (here.cost - value) / promised if accepted and promised > 0.0 else 0.0
            if accepted:
                used, factor = damping, max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3)
                damping, growth = max(damping * factor, _SMALLEST_DAMPING), 2.0
            elif float(np.abs(move).max()) < 1e-14:
                break
            else:
                damping, growth = damping * growth, 2.0 * growth
        if not accepted:  # no smaller cost within rounding
            return Minimum(x, here.cost, tuple(history), True)
        before, x, here = here.cost, candidate, normal_equations(candidate)
        history.append(Iteration(here.cost, used, float(np.abs(move).max()), int((~free).sum()), trials))
        small = before - here.cost <= tolerance * before and promised <= 10.0 * tolerance * before
        held, free = ~free, _free(x, here.gradient, bounds)  # what may leave a bound now is still to come
        settled = small and not (held & free).any() and _settled(here, free, precision)
        if settled or history[-1].step <= tolerance * 1e-3:
            return Minimum(x, here.cost, tuple(history), True)
    return Minimum(x, here.cost, tuple(history), not here.cost > 0.0)


def _settled(here: NormalEquations, free: npt.NDArray[np.bool_], precision: float) -> bool:
    """Return whether the optimum is nearer than a fraction of the standard errors, of all in the mean square.

    g' H^-1 g is what a full step would gain; sum_b s_b' H^-1 s_b what chance makes of it at the optimum of
    other data.
    """
    if here.scores is None or len(here.scores) < 2 or not np.isfinite(precision):
        return True
    gram, scores = here.gram[np.ix_(free, free)], here.scores[:, free]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-200))
    inverse = np.linalg.pinv(gram * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    spread = (scores - scores.mean(axis=0)) * scale
    gradient = here.gradient[free] * scale
    left, chance = gradient @ inverse @ gradient, np.einsum("bi,ij,bj->", spread, inverse, spread)
    return bool(left <= precision**2 * chance)


def _free(x: Array, gradient: Array, bounds: tuple[Array, Array]) -> npt.NDArray[np.bool_]:
    """Return which coordinates a step may move: `gradient` (J'r) points downhill."""
    held = ((x <= bounds[0]) & (gradient <= 0.0)) | ((x >= bounds[1]) & (gradient >= 0.0))
    free: npt.NDArray[np.bool_] = ~held & np.isfinite(gradient)
    return free


def _step(here: NormalEquations, free: npt.NDArray[np.bool_], damping: float, largest: Array) -> Array:
    """Return the damped Gauss-Newton step of the free coordinates, solved with unit diagonal."""
    step = np.zeros_like(here.gradient)
    gram, gradient = here.gram[np.ix_(free, free)], here.gradient[free]
    diagonal = np.diag(gram)
    scale = np.sqrt(np.maximum(diagonal, max(1e-30 * float(diagonal.max()), 1e-200)))
    matrix = gram / np.outer(scale, scale) + damping * np.eye(len(scale))
    step[free] = np.linalg.lstsq(matrix, gradient / scale, rcond=1e-15)[0] / scale
    # Each coordinate by itself: one that is hardly determined must not hold back the others.
    limited: Array = np.clip(step, -largest, largest)
    return limited

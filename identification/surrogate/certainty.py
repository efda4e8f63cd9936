"""How sure the parameters of a surrogate are: Fisher information, standard errors, what cannot be told apart.

Thesis 5.1.1 with what it left open: eq. 5.1-5.2 take the state as given (`partial`), eq. 5.3 follows the
parameters through the whole simulation (`coupled`). Standard errors come from the coupled sensitivities and
the residuals as they are: correlated over time, because most of them are errors of the model, not noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from identification.arrays import Array
from identification.surrogate.chain import OUTPUT_NAMES, STATE_NAMES
from identification.surrogate.output_error import box
from identification.surrogate.problem import NetworkParameters, OutputErrorProblem
from identification.surrogate.recursion import BlendedModels, Experiment, Observation, run
from identification.surrogate.structure import Structure

LARGEST_CONDITION = 1e8
"""Of the Fisher matrix scaled to unit diagonal; beyond it the inverse is rounding: no errors are given."""

CLOSE = 0.95
"""Magnitude of the correlation from which data hardly tell two numbers apart."""

_CORRELATED = 0.1  # autocorrelation of a residual that still counts
_SPANS = 5  # of the longest such lag, in a block
_BLOCK_ROWS, _FEWEST_BLOCKS = 10, 20  # fewest of each
_NOISE_FLOOR = 1e-9  # of a signal's own size: residuals of noise-free data are rounding
_TOLD = 0.3  # of the largest part of a direction: smaller parts are left out of its description
_PARTIAL_ROWS = 20_000  # evenly spaced ones stand for all

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Certainty:
    """How sure a theta is.

    Attributes:
        standard_errors: Per local model and parameter, in the parameter's unit, (M, P); NaN where it stood
            at a bound, and everywhere if the Fisher matrix cannot be inverted.
        white_errors: The same if residuals were white noise, (M, P): what the textbook formula gives.
        correlations: Between the parameters of each local model, (M, P, P); NaN likewise.
        condition: Of the Fisher matrix scaled to unit diagonal.
        partial: Eq. 5.1-5.2 per state, local model and parameter, (6, M, P): information about the parameter
            in its own unit, every state divided by the standard deviation of its motion about rest.
        coupled: Eq. 5.3, likewise.
        blocks: Stretches of residuals that count as independent.
        close: Pairs of estimated numbers, of all local models and of the schedule, whose correlation is
            `CLOSE` and more, with that.
        remarks: What cannot be told, in words.
    """

    standard_errors: Array
    white_errors: Array
    correlations: Array
    condition: float
    partial: Array
    coupled: Array
    blocks: int
    close: tuple[tuple[str, str, float], ...]
    remarks: tuple[str, ...]


def certainty(problem: OutputErrorProblem, parameters: NetworkParameters) -> Certainty:
    """Return how sure parameters are that minimise the cost over the problem's data.

    The covariance is H^-1 S H^-1 with H = sum J'W J of the cost of eq. 3.39 and S = sum s_b s_b' over the
    gradients s_b of stretches of data that are long against the correlation of the residuals (Huber 1967;
    White 1982, with clusters). Where the residuals are white noise that is what the Fisher information says
    of this cost.

    Args:
        problem: The data that `parameters` were found on.
        parameters: Where.
    """
    if not np.isfinite(problem.cost(parameters)):
        return _nothing(parameters)
    free, sizes = _free(problem, parameters), problem.column_sizes()
    residuals = [one.target - problem.simulate(parameters, one) for one in problem.experiments]
    models, rows = problem.models(parameters, True), _block_rows(problem, residuals)
    passes = [run(models, one, problem.observation, block_rows=rows) for one in problem.experiments]
    gram = np.sum([one.gram for one in passes], axis=0) * np.outer(sizes, sizes)
    scores = np.concatenate([one.blocks for one in passes]) * sizes
    noise = _covariance(problem, residuals)
    known = np.zeros((len(STATE_NAMES),) * 2)
    known[: len(OUTPUT_NAMES), : len(OUTPUT_NAMES)] = np.linalg.inv(noise[:4, :4])
    condition, remarks = told_apart(_gram(problem, models, known), problem.names, free)
    shape = parameters.theta.shape
    errors, white = np.full(shape, np.nan), np.full(shape, np.nan)
    correlations = np.full((*shape, shape[1]), np.nan)
    close: tuple[tuple[str, str, float], ...] = ()
    if condition <= LARGEST_CONDITION:
        covariance = _sandwich(gram, _scatter(scores), free)
        weighted = problem.observation.matrix.T * problem.observation.weight
        one_by_one = _gram(problem, models, weighted @ noise @ weighted.T)
        errors = _in_units(problem, parameters, covariance)
        white = _in_units(problem, parameters, _sandwich(gram, one_by_one, free))
        correlations, close = _correlations(problem, parameters, covariance)
        remarks += unsure(problem.structure, parameters.theta, errors)
    return Certainty(
        errors,
        white,
        correlations,
        condition,
        partial_information(problem, parameters),
        coupled_information(problem, parameters),
        len(scores),
        close,
        held(problem.structure, parameters.theta) + remarks,
    )


def _free(problem: OutputErrorProblem, parameters: NetworkParameters) -> Mask:
    """Return what of the search vector was estimated and stands at no bound."""
    search = problem.to_search(parameters)
    lower, upper = box(problem, search, "all")
    free: Mask = (search > lower) & (search < upper)
    own = free[: search.size - problem.schedule_size].reshape(len(parameters.theta), -1)  # a view
    for row, theta in zip(own, parameters.theta, strict=True):
        at_bound = problem.structure.at_bound(theta)
        row[: theta.size] &= [name not in at_bound for name in problem.structure.names]
    return free


def _nothing(parameters: NetworkParameters) -> Certainty:
    """Return what is known of a network that runs away on the data."""
    shape = parameters.theta.shape
    none, states = np.full(shape, np.nan), np.full((len(STATE_NAMES), *shape), np.nan)
    correlations = np.full((*shape, shape[1]), np.nan)
    why = "the network runs away on the data it was tuned on; no standard errors are given"
    return Certainty(none, none, correlations, float("inf"), states, states, 0, (), (why,))


def told_apart(fisher: Array, names: tuple[str, ...], free: Mask) -> tuple[float, tuple[str, ...]]:
    """Return the condition of a Fisher matrix scaled to unit diagonal, and what cannot be told, in words.

    Args:
        fisher: In search coordinates, (columns, columns).
        names: Of the columns.
        free: Which of them were estimated.
    """
    labels = [name for name, moves in zip(names, free, strict=True) if moves]
    matrix = fisher[np.ix_(free, free)]
    size = np.sqrt(np.diag(matrix))
    mute = [label for label, one in zip(labels, size, strict=True) if not one > 0.0]
    if mute or not labels:
        return float("inf"), tuple(f"{label} has no influence on these data" for label in mute)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    condition = float(values[-1] / values[0]) if values[0] > 0.0 else float("inf")
    remarks = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value * LARGEST_CONDITION >= values[-1]:
            break
        parts = np.abs(vector) >= _TOLD * np.abs(vector).max()
        told = ", ".join(label for label, part in zip(labels, parts, strict=True) if part)
        together = "can move together" if parts.sum() > 1 else "can move"
        remarks.append(f"{told} {together} without a visible effect; no standard errors are given")
    return condition, tuple(remarks)


def coupled_information(problem: OutputErrorProblem, parameters: NetworkParameters) -> Array:
    """Return the diagonal of eq. 5.1 with the sensitivities of eq. 5.3, (6, M, P); see `Certainty.coupled`.

    Args:
        problem: Data.
        parameters: Where.
    """
    models, sizes = problem.models(parameters, True), problem.column_sizes()
    found = []
    for index, spread in enumerate(_motion(problem, parameters)):
        picked = np.zeros((len(STATE_NAMES),) * 2)
        picked[index, index] = 1.0 / spread**2
        information = np.diag(_gram(problem, models, picked)) * sizes**2
        found.append(
            _local(problem, parameters, information) / problem.structure.slope(parameters.theta) ** 2
        )
    return np.array(found)


def partial_information(problem: OutputErrorProblem, parameters: NetworkParameters) -> Array:
    """Return the diagonal of eq. 5.1 with the sensitivities of eq. 5.2, (6, M, P); see `Certainty.partial`.

    The state, moved to the equilibrium of the height at hand, counts as given.

    Args:
        problem: Data.
        parameters: Where.
    """
    models = problem.models(parameters, True)
    total = np.zeros((len(STATE_NAMES), *parameters.theta.shape))
    for experiment in problem.experiments:
        total += _partial(models, experiment, _states(models, experiment), parameters.theta.shape[1])
    slope = problem.structure.slope(parameters.theta)
    return np.asarray(total / _motion(problem, parameters)[:, None, None] ** 2 / slope**2)


def _partial(models: BlendedModels, experiment: Experiment, states: Array, parameters: int) -> Array:
    """Return the sum over the rows of (d x_k+1 / d parameter at a given x_k)^2, (6, M, P)."""
    step = -(-len(states) // _PARTIAL_ROWS)
    used = slice(1, None, step)
    pairs = _neighbours(models, experiment, states)
    equilibrium = np.sum([w[:, None] * models.g[index] for index, w in pairs], axis=0)
    change = np.diff(experiment.scheduling, prepend=experiment.scheduling[0])
    held = np.vstack([equilibrium[:1], equilibrium[:-1]])
    x = (states - 0.5 * (equilibrium + held) * change[:, None])[used]
    owned = np.sum([w[:, None] * models.shares[index] for index, w in pairs], axis=0)
    u = experiment.inputs
    if models.input_offsets.size:
        u = u - owned @ models.input_offsets
    u = u[used]
    total = np.zeros((states.shape[1], models.shares.shape[1], parameters))
    for p in range(parameters):
        psi = np.zeros((models.shares.shape[1], *x.shape))
        for index, w in pairs:
            index, w = index[used], w[used]
            moved = np.einsum("krc,kc->kr", models.dA[index, :, :, p], x)
            moved += np.einsum("krc,kc->kr", models.dB[index, :, :, p], u)
            psi += (models.shares[index] * w[:, None]).T[:, :, None] * moved
        total[:, :, p] = step * (psi**2).sum(axis=1).T
    return total


def _neighbours(
    models: BlendedModels, experiment: Experiment, states: Array
) -> list[tuple[npt.NDArray[np.intp], Array]]:
    """Return index and weight of the models that count at every row, one pair per rank."""
    rows = len(states)
    if not models.positions.size:
        return [(np.full(rows, k), experiment.blend[:, k]) for k in range(experiment.blend.shape[1])]
    wanted = experiment.scheduling + models.gain * states[:, models.deviation_state]
    r = np.clip(wanted, models.positions[0], models.positions[-1])
    cell = np.clip(np.searchsorted(models.positions, r, side="right") - 1, 0, len(models.positions) - 2)
    share = (r - models.positions[cell]) / (models.positions[cell + 1] - models.positions[cell])
    return [(cell, 1.0 - share), (cell + 1, share)]


def _states(models: BlendedModels, experiment: Experiment) -> Array:
    """Return the simulated states, (N, 6)."""
    own = Observation(np.eye(len(STATE_NAMES)), np.ones(len(STATE_NAMES)))
    return run(models.plain, experiment, own, simulate=True).simulated


def _motion(problem: OutputErrorProblem, parameters: NetworkParameters) -> Array:
    """Return the standard deviation of every state, (6,)."""
    models = problem.models(parameters, False)
    spread = np.concatenate([_states(models, one) for one in problem.experiments]).std(axis=0)
    return np.asarray(np.where(spread > 0.0, spread, 1.0))


def _covariance(problem: OutputErrorProblem, residuals: list[Array]) -> Array:
    """Return the covariance of the residuals of `SIGNALS`, (6, 6), never below rounding."""
    targets = np.concatenate([one.target for one in problem.experiments])
    floor = (_NOISE_FLOOR * targets.std(axis=0)) ** 2
    return np.asarray(np.cov(np.concatenate(residuals).T) + np.diag(floor))


def _gram(problem: OutputErrorProblem, models: BlendedModels, weight: Array) -> Array:
    """Return sum_k S' weight S of the sensitivities S of the states, (columns, columns).

    Args:
        problem: Data.
        models: With slopes.
        weight: Symmetric, not negative, (6, 6).
    """
    values, vectors = np.linalg.eigh(0.5 * (weight + weight.T))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    own = Observation(root, np.ones(len(root)))
    grams = [run(models, one, own, sensitivities=True).gram for one in problem.experiments]
    sizes = problem.column_sizes()
    return np.asarray(np.sum(grams, axis=0) * np.outer(sizes, sizes))


def _scatter(scores: Array) -> Array:
    """Return sum_b s_b s_b' of the scores about their mean, (columns, columns)."""
    spread = scores - scores.mean(axis=0)
    return np.asarray(len(scores) / max(len(scores) - 1, 1) * spread.T @ spread)


def _sandwich(gram: Array, middle: Array, free: Mask) -> Array:
    """Return H^-1 S H^-1 of the free columns, NaN elsewhere."""
    inside = np.ix_(free, free)
    scale = 1.0 / np.sqrt(np.diag(gram)[free])
    inverse = np.linalg.pinv(gram[inside] * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)
    found = np.full_like(gram, np.nan)
    found[inside] = inverse @ middle[inside] @ inverse
    return found


def _local(problem: OutputErrorProblem, parameters: NetworkParameters, columns: Array) -> Array:
    """Return the entries of theta of a row over the search vector, (M, P)."""
    count, kinds = parameters.theta.shape
    return np.asarray(columns[: columns.size - problem.schedule_size].reshape(count, -1)[:, :kinds])


def _in_units(problem: OutputErrorProblem, parameters: NetworkParameters, covariance: Array) -> Array:
    """Return standard errors of theta in its own units, (M, P)."""
    slope = problem.structure.slope(parameters.theta)
    return np.asarray(_local(problem, parameters, np.sqrt(np.diag(covariance))) * slope)


def _correlations(
    problem: OutputErrorProblem, parameters: NetworkParameters, covariance: Array
) -> tuple[Array, tuple[tuple[str, str, float], ...]]:
    """Return the correlations within each local model, (M, P, P), and the close pairs of all numbers."""
    size = np.sqrt(np.diag(covariance))
    whole, names = covariance / np.outer(size, size), problem.names
    places = _local(problem, parameters, np.arange(float(len(covariance)))).astype(int)
    close = tuple(
        (names[row], names[column], float(whole[row, column]))
        for row, column in zip(*np.triu_indices(len(names), 1), strict=True)
        if abs(whole[row, column]) >= CLOSE
    )
    return np.array([whole[np.ix_(at, at)] for at in places]), close


def _block_rows(problem: OutputErrorProblem, residuals: list[Array]) -> int:
    """Return the rows of a stretch of residuals that counts as independent of the next.

    Args:
        problem: Data.
        residuals: Of every experiment, (N, 6).
    """
    longest = 1
    for one in residuals:
        spread = one - one.mean(axis=0)
        size = 2 * len(one)
        power = np.abs(np.fft.rfft(spread, size, axis=0)) ** 2
        correlation = np.fft.irfft(power, size, axis=0)[: len(one) // 2]
        lags = np.flatnonzero((np.abs(correlation) > _CORRELATED * correlation[0]).any(axis=1))
        longest = max(longest, int(lags.max(initial=0)) + 1)
    shortest = min(len(one) for one in residuals)
    most = max(1, min(problem.rows // _FEWEST_BLOCKS, shortest))
    return min(max(_BLOCK_ROWS, _SPANS * longest), most)


def unsure(structure: Structure, theta: Array, errors: Array) -> tuple[str, ...]:
    """Name the parameters (M, P) whose standard error (M, P) is above their value."""
    told = []
    for k, (row, error) in enumerate(zip(theta, errors, strict=True)):
        for parameter, value, one in zip(structure.parameters, row, error, strict=True):
            if one > abs(value):
                unit = f" {parameter.unit}" if parameter.unit else ""
                told.append(
                    f"{parameter.name}[{k + 1}] = {value:.3g} +- {one:.2g}{unit} cannot be told from zero"
                )
    return tuple(told)


def held(structure: Structure, theta: Array) -> tuple[str, ...]:
    """Name the parameters (M, P) that stand at a bound."""
    return tuple(
        f"{name}[{k + 1}] stands at a bound: no standard error"
        for k, row in enumerate(theta)
        for name in structure.at_bound(row)
    )

"""Where local models are worth their data: centres placed by how fast the linearised plant changes.

Two stages: a coarse pass gives local models at a few operating points (or linearisations at many); `placed`
returns the centres at which the operating-point data of the second pass are to be recorded, and
`N4sidSettings.centres` takes them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.local_model import LocalModel


def response_distances(
    models: Sequence[LocalModel], frequencies: Array, input_scale: Array, output_scale: Array
) -> Array:
    """Return how much each model differs from the next, shape (M - 1,).

    The root mean square over frequencies, inputs and outputs of the change of the frequency response, inputs
    and outputs counted in their sizes: the size of the output difference when both models get the same input.

    Args:
        models: Local models in the order of the scheduling variable.
        frequencies: [Hz], shape (frequencies,).
        input_scale: Size of the inputs at each frequency, shape (frequencies, m) or (m,).
        output_scale: Size of the outputs, shape (p,).
    """
    responses = np.array([model.frequency_response(frequencies) for model in models])
    size = np.broadcast_to(input_scale, (len(frequencies), responses.shape[-1]))
    scaled = responses * size[None, :, None, :] / np.asarray(output_scale)[:, None]
    return np.asarray(np.sqrt(np.mean(np.abs(np.diff(scaled, axis=0)) ** 2, axis=(1, 2, 3))))


def placed(
    positions: Array,
    distances: Array,
    count: int,
    limits: tuple[float, float],
    weight: float = 0.5,
) -> Array:
    """Return centres that share the change of the models and the length of the range, shape (count,).

    The range is measured by s = (1 - weight) * length + weight * arc length of the models, both in shares of
    the whole; each centre is the middle of one of `count` equal cells of s. Weight 0 gives equidistant
    centres, weight 1 equal changes only, which leaves long stretches without a centre.

    Args:
        positions: Values of the scheduling variable of the coarse pass, ascending, shape (K,).
        distances: Change of the models between two of them, shape (K - 1,).
        count: Number of centres.
        limits: Ends of the range; beyond the outer positions the change goes on at the outer rates.
        weight: Share of the arc length, 0 to 1.

    Raises:
        IdentificationError: Positions that do not ascend within the limits, other shapes, no change at all.
    """
    where, change = np.asarray(positions, dtype=np.float64), np.asarray(distances, dtype=np.float64)
    found = []
    if where.ndim != 1 or where.size < 2 or change.shape != (where.size - 1,):
        what = f"{where.size} positions and {change.size} distances"
        found.append(Problem("placement", what, "Give at least two positions, and one distance less"))
    elif not (np.all(np.diff(where) > 0.0) and limits[0] <= where[0] and where[-1] <= limits[1]):
        found.append(Problem("placement", "positions do not ascend within the limits", "Sort and cut them"))
    elif not (np.all(np.isfinite(change)) and change.min() >= 0.0 and change.sum() > 0.0):
        found.append(Problem("placement", "distances are not finite, positive numbers", "Check the models"))
    if count < 1 or not 0.0 <= weight <= 1.0:
        found.append(Problem("placement", f"count {count}, weight {weight}", "Give count >= 1, weight 0..1"))
    if found:
        raise IdentificationError(found)
    rate = change / np.diff(where)
    corners = np.array([limits[0], *where[1:-1], limits[1]])
    arc = np.concatenate([[0.0], np.cumsum(rate * np.diff(corners))])
    measure = (1.0 - weight) * (corners - corners[0]) / (corners[-1] - corners[0]) + weight * arc / arc[-1]
    return np.asarray(np.interp((np.arange(count) + 0.5) / count, measure, corners))

"""The static map: outputs at rest over the scheduling input, all other inputs at their operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from fmu_builder import parameter_set
from fmu_builder.errors import DataError, IdentificationError, Problem
from identification.arrays import Array, read_only
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.validity import cubic_weights, hat_weights


@dataclass(frozen=True, eq=False)
class StaticMap:
    """A table of outputs at rest; linear in between, the end segments go on.

    Attributes:
        positions: Values of the scheduling input, ascending, shape (L,), L >= 2.
        values: Outputs at rest, shape (L, p).
        names: Names of the p outputs.

    Raises:
        DataError: Fewer than two positions, not ascending, shapes or numbers that do not fit; all at once.
    """

    positions: Array
    values: Array
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        found = []
        object.__setattr__(self, "positions", read_only(self.positions, 1))
        object.__setattr__(self, "values", read_only(self.values, 2))
        if self.positions.size < 2 or not np.all(np.diff(self.positions) > 0.0):
            what = "has fewer than two or unordered positions"
            found.append(Problem("static map", what, "Give two or more ascending positions"))
        if self.values.shape != (self.positions.size, len(self.names)):
            what = f"has values of the shape {self.values.shape}"
            mend = f"Give {self.positions.size} rows of {len(self.names)} outputs"
            found.append(Problem("static map", what, mend))
        if not (np.all(np.isfinite(self.positions)) and np.all(np.isfinite(self.values))):
            found.append(Problem("static map", "is not finite", "Leave out positions that cannot be reached"))
        if found:
            raise DataError(found)

    def at(self, positions: Array) -> Array:
        """Return the outputs at rest, shape (positions, p)."""
        hats = hat_weights(np.atleast_1d(np.asarray(positions)), self.positions.tolist(), clamped=False)
        return np.asarray(hats @ self.values)

    def select(self, names: Sequence[str]) -> StaticMap:
        """Return the map of some of the outputs, in that order.

        Raises:
            DataError: Outputs are missing; all of them are named.
        """
        missing = [name for name in names if name not in self.names]
        if missing:
            mend = f"It has {', '.join(self.names)}"
            raise DataError([Problem("static map", f"has no output {name!r}", mend) for name in missing])
        columns = [self.names.index(name) for name in names]
        return StaticMap(self.positions, self.values[:, columns], tuple(names))

    def as_part(self) -> parameter_set.StaticMap:
        """Return it as it stands in a parameter set."""
        return parameter_set.StaticMap(
            positions=parameter_set.nested(self.positions), values=parameter_set.nested(self.values)
        )


def from_local_models(
    models: Sequence[LocalModel],
    centres: Sequence[float],
    operating_point: Mapping[str, float],
    scheduling: str,
    limits: tuple[float, float],
    count: int = 41,
) -> StaticMap:
    """Return the map through the rest points of local models: no data beyond theirs are needed.

    Model i rests at y_op,i + G_i(1) (u_i - u_op,i), u_i being its centre and the operating point of the other
    inputs. A polynomial (up to four models) or a cubic spline goes through these points; a single model gives
    the straight line of its gain.

    Args:
        models: M local models.
        centres: Their M centres, ascending.
        operating_point: Operating point of every input but the scheduling one.
        scheduling: Name of the scheduling input.
        limits: Ends of the table.
        count: Number of positions, equally spaced.
    """
    index = models[0].inputs.index(scheduling)
    rest = []
    for model, centre in zip(models, centres, strict=True):
        u = np.array([centre if name == scheduling else operating_point[name] for name in model.inputs])
        y_op, gain = model.output_operating_point, model.dc_gain
        rest.append(y_op + gain @ (u - model.input_operating_point))
    positions = np.linspace(*limits, count)
    if len(models) == 1:
        values = rest[0] + np.outer(positions - centres[0], models[0].dc_gain[:, index])
    else:
        values = cubic_weights(positions, centres) @ np.array(rest)
    return StaticMap(positions, values, models[0].outputs)


def from_data(
    experiments: Sequence[DataSet],
    scheduling: str,
    operating_point: Mapping[str, float],
    outputs: Sequence[str],
    count: int = 9,
) -> StaticMap:
    """Return the map by regression on data that move slowly through the range (whole-range data).

    y = sum_l hat_l(scheduling) y_l + k (u_other - u_op,other) by least squares, knots equally spaced from the
    smallest to the largest value seen: what is fast and of zero mean averages out.

    Args:
        experiments: Data sets with all signals.
        scheduling: Name of the scheduling input.
        operating_point: Operating point of the other inputs.
        outputs: Names of the p outputs.
        count: Number of knots.

    Raises:
        DataError: Columns are missing.
        IdentificationError: The data leave a stretch of the range empty.
    """
    others = [name for name in operating_point if name != scheduling]
    eta = np.concatenate([data.column(scheduling) for data in experiments])
    y = np.concatenate([data.matrix(outputs) for data in experiments])
    u = np.concatenate([data.matrix(others) for data in experiments])
    knots = np.linspace(eta.min(), eta.max(), count)
    hats = hat_weights(eta, knots.tolist(), clamped=False)
    empty = np.flatnonzero(hats.sum(axis=0) < 1.0)
    if empty.size or not knots[0] < knots[-1]:
        where = ", ".join(f"{knots[k]:.3g}" for k in empty) or f"{knots[0]:.3g} only"
        what = f"data leave gaps at {scheduling} = {where}"
        raise IdentificationError.of("static map", what, "Use data through the whole range, or fewer knots")
    deviation = u - np.array([operating_point[name] for name in others])
    table = np.column_stack([hats, deviation])
    scale = np.sqrt(np.mean(table**2, axis=0)) + np.finfo(float).tiny
    solution = scipy.linalg.lstsq(table / scale, y)[0] / scale[:, None]
    return StaticMap(knots, solution[:count], tuple(outputs))

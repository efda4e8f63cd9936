"""What a network gets wrong on whole-range training data, fast enough for a search over its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.kernel import Tables, simulate, tables_of, with_validity
from fmu_builder.parameter_set import ParameterSet, Partition
from identification.arrays import Array
from identification.blending import blended, in_coordinates, stacked
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.scores import moves, scored_rows
from identification.validity import weights


@dataclass(frozen=True)
class Candidate:
    """What a search varies of a network.

    Attributes:
        partition: Partition with other numbers of its validity and another deviation gain.
        generator: E of the state coordinates `coordinate_transforms` makes, shape (n, n); None: as they are.
    """

    partition: Partition
    generator: Array | None = None


def coordinate_transforms(partition: Partition, generator: Array) -> Array:
    """Return T_i = expm(s_i E), s_i being the centre from -1 to 1 over the range, shape (M, n, n).

    A blend of matrices depends on how the state coordinates of the local models move with the scheduling
    variable; E is that motion, to first order and the same everywhere. The models themselves do not change.

    Args:
        partition: Centres and range.
        generator: E, shape (n, n).
    """
    low, high = partition.range
    places = (np.array(partition.centres) - 0.5 * (low + high)) / (0.5 * (high - low))
    return np.asarray(scipy.linalg.expm(places[:, None, None] * generator))


def transformed(models: Sequence[LocalModel], partition: Partition, generator: Array) -> list[LocalModel]:
    """Return local models in the coordinates of `coordinate_transforms`."""
    transforms = coordinate_transforms(partition, generator)
    return [model.transformed(T) for model, T in zip(models, transforms, strict=True)]


class Objective:
    """Errors of a network on training data, every signal divided by its size.

    Derived outputs are computed from the data's own outputs and inputs, as the network computes them. The
    sum of squares is the sum over the signals of (1 - FIT/100)^2: the cost of thesis eq. 3.39 with the
    signals' variances as weights.

    Attributes:
        names: The signals that count.
    """

    def __init__(
        self, example: ParameterSet, training: Sequence[DataSet], signals: Sequence[str] | None = None
    ) -> None:
        """Prepare the search around a network.

        Args:
            example: A network that differs from the candidates in what a `Candidate` holds only.
            training: Whole-range training data.
            signals: Outputs and derived outputs that count; default all that move.

        Raises:
            DataError: Columns are missing, or another sample time or other units than the network's.
            IdentificationError: A signal that the network does not have, or that does not move in the data.
        """
        wanted = example.output_names if signals is None else tuple(signals)
        unknown = [name for name in wanted if name not in example.output_names]
        if unknown:
            what = f"{', '.join(unknown)}: the network has no such output"
            mend = f"Name some of {', '.join(example.output_names)}"
            raise IdentificationError.of("signals of the tuning", what, mend)
        refuse_other_scales(example, training)
        self._inputs = [data.matrix(example.input_names) for data in training]
        self._rows = [scored_rows(len(data)) for data in training]
        targets = [outputs_of(example, data)[rows] for data, rows in zip(training, self._rows, strict=True)]
        size = np.sqrt(np.sum([((one - one.mean(axis=0)) ** 2).sum(axis=0) for one in targets], axis=0))
        # FIT knows no size of a signal at rest
        moving = dict(zip(example.output_names, np.any([moves(one) for one in targets], axis=0), strict=True))
        still = [name for name in wanted if not moving[name]]
        if still and (signals is not None or len(still) == len(wanted)):
            what = f"{', '.join(still)}: constant in the whole-range training data"
            raise IdentificationError.of("signals of the tuning", what, "Name signals that move")
        self.names = tuple(name for name in wanted if moving[name])
        self._columns = [example.output_names.index(name) for name in self.names]
        self._targets = [target[:, self._columns] for target in targets]
        self._scale = size[self._columns]
        self._tables, self._example = tables_of(example), example
        self._stack = stacked(example.local_models)

    def residuals(self, candidate: Candidate) -> Array | None:
        """Return the scaled errors in one row, None where the network runs away."""
        tables = self._candidate_tables(candidate)
        with np.errstate(over="ignore", invalid="ignore"):
            parts = [
                ((simulate(tables, u)[rows][:, self._columns] - target) / self._scale).ravel()
                for u, rows, target in zip(self._inputs, self._rows, self._targets, strict=True)
            ]
            together = np.concatenate(parts)
            usable = bool(np.isfinite(together @ together))
        return together if usable else None

    def cost(self, candidate: Candidate) -> float:
        """Return the sum of squares, infinite where there is none."""
        errors = self.residuals(candidate)
        return np.inf if errors is None else float(errors @ errors)

    def fits(self, candidate: Candidate) -> dict[str, float]:
        """Return FIT by signal [%], minus infinity where the network runs away."""
        errors = self.residuals(candidate)
        if errors is None:
            return dict.fromkeys(self.names, -np.inf)
        squares = (errors.reshape(-1, len(self.names)) ** 2).sum(axis=0)
        return dict(zip(self.names, (100.0 * (1.0 - np.sqrt(squares))).tolist(), strict=True))

    def percent(self, cost: float) -> float:
        """Return a cost as root mean square over the signals, in per cent of their size (100 - FIT)."""
        return float(100.0 * np.sqrt(cost / len(self.names)))

    def _candidate_tables(self, candidate: Candidate) -> Tables:
        stack = self._stack
        if candidate.generator is not None:
            transforms = coordinate_transforms(candidate.partition, candidate.generator)
            stack = in_coordinates(stack, transforms)
        nodes = self._example.node_table
        if nodes is None:
            models = None if candidate.generator is None else stack
            return with_validity(self._tables, candidate.partition, None, models)
        shares = weights(candidate.partition, np.array(nodes.positions))
        output = self._example.blending == "output"
        return with_validity(
            self._tables, candidate.partition, shares, None if output else blended(stack, shares)
        )


def refuse_other_scales(example: ParameterSet, training: Sequence[DataSet]) -> None:
    """Refuse data that have another sample time or other units than a network.

    Raises:
        DataError: All problems of all data sets.
    """
    signals = (*example.inputs, *example.outputs)
    names, units = [one.name for one in signals], [one.unit for one in signals]
    found = []
    for data in training:
        found += data.scale_problems(example.sample_time, names, units)
    if found:
        raise DataError(found)


def outputs_of(parameter_set: ParameterSet, data: DataSet) -> Array:
    """Return outputs and derived outputs of data in the network's order, shape (rows, p + R)."""
    names = [*(one.name for one in parameter_set.outputs), *parameter_set.input_names]
    signals = dict(zip(names, data.matrix(names).T, strict=True))
    columns = [signals[one.name] for one in parameter_set.outputs]
    for derived in parameter_set.derived_outputs:
        values = {name: parameter.value for name, parameter in derived.parameters.items()}
        columns.append(
            np.sum([t.sign * values[t.parameter] * signals[t.signal] for t in derived.terms], axis=0)
        )
    return np.column_stack(columns)

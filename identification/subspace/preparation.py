"""Experiments made ready: usable at all, means off, scaled, and exciting enough (thesis eq. 3.71)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.data_set import DataSet
from identification.scores import AT_REST
from identification.subspace.settings import SubspaceSettings

_EXCITED = 1e-13
"""Smallest eigenvalue of the unit-diagonal covariance of stacked inputs that still counts as exciting."""


@dataclass(frozen=True, eq=False)
class ScaledData:
    """Experiments as deviations, each from its own mean, in units of their standard deviation.

    Own means, because sensors drift from one experiment to the next: such a constant would look like a slow
    state. In the data equation a constant per experiment is projected out exactly, however short it is.

    Attributes:
        names: Inputs, then outputs.
        sample_time: Ts [s].
        inputs: One (m, samples) array per experiment.
        outputs: One (p, samples) array per experiment.
        input_mean: Mean of all samples, shape (m,); likewise the others.
    """

    names: tuple[str, ...]
    sample_time: float
    inputs: list[Array]
    outputs: list[Array]
    input_mean: Array
    output_mean: Array
    input_scale: Array
    output_scale: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Number of inputs m and outputs p."""
        return len(self.input_mean), len(self.output_mean)

    @property
    def rows(self) -> int:
        """Samples of all experiments."""
        return sum(one.shape[1] for one in self.inputs)

    @property
    def shares(self) -> Array:
        """Part of all samples that every experiment has, shape (experiments,)."""
        return np.array([one.shape[1] for one in self.inputs]) / self.rows

    @cached_property
    def stacked(self) -> list[Array]:
        """Inputs above outputs, one (m + p, samples) array per experiment."""
        return [np.vstack(pair) for pair in zip(self.inputs, self.outputs, strict=True)]

    @property
    def most_block_rows(self) -> int:
        """Longest windows s of which the longest experiment holds enough."""
        longest: int = max(one.shape[1] for one in self.inputs)
        return longest // (2 * (sum(self.shape) + 1))

    def windows(self, depth: int) -> int:
        """Return how many windows of `depth` samples lie inside one experiment."""
        return sum(max(one.shape[1] - depth + 1, 0) for one in self.inputs)


def prepared(
    experiments: Sequence[DataSet], inputs: Sequence[str], outputs: Sequence[str], settings: SubspaceSettings
) -> ScaledData:
    """Return the experiments scaled.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Nothing given, sample times differ, too short, constant signals, an order that
            the windows cannot hold; all at once.
    """
    found = _unusable(experiments, inputs, outputs, settings)
    if found:
        raise IdentificationError(found)
    names = (*inputs, *outputs)
    values = [np.ascontiguousarray(data.matrix(names).T) for data in experiments]
    count = sum(one.shape[1] for one in values)
    mean = np.sum([one.sum(axis=1) for one in values], axis=0) / count
    values = [one - one.sum(axis=1, keepdims=True) / one.shape[1] for one in values]
    scale = np.sqrt(np.sum([np.einsum("ij,ij->i", one, one) for one in values], axis=0) / count)
    for name, middle, size in zip(names, mean, scale, strict=True):
        if not size > AT_REST * abs(middle):
            mend = "Excite it, or leave it out of the model"
            where = "the training data" if len(values) == 1 else "every experiment of the training data"
            found.append(Problem(f"signal {name!r}", f"is constant in {where}", mend))
    if found:
        raise IdentificationError(found)
    for one in values:
        one /= scale[:, None]
    m = len(inputs)
    return ScaledData(
        names,
        experiments[0].sample_time,
        [one[:m] for one in values],
        [one[m:] for one in values],
        mean[:m],
        mean[m:],
        scale[:m],
        scale[m:],
    )


def _unusable(
    experiments: Sequence[DataSet], inputs: Sequence[str], outputs: Sequence[str], settings: SubspaceSettings
) -> list[Problem]:
    if not experiments or not inputs or not outputs:
        what = f"{len(experiments)} experiments, {len(inputs)} inputs, {len(outputs)} outputs"
        return [Problem("subspace identification", what, "Give at least one of each")]
    found = []
    steps = {data.sample_time for data in experiments}
    if len(steps) > 1:
        what = f"the experiments have the sample times {', '.join(f'{step:g} s' for step in sorted(steps))}"
        found.append(Problem("subspace identification", what, "Resample them to one"))
    channels, p = len(inputs) + len(outputs), len(outputs)
    order: int | Literal["auto"] = settings.identified_order
    least = 2 if order == "auto" else least_block_rows(order, p)
    block_rows = least if settings.block_rows == "auto" else settings.block_rows
    # a short experiment beside a long one adds no long windows, but to B and D
    longest = max(experiments, key=len)
    for data in experiments:
        rows = block_rows if data is longest else min(least, block_rows)
        needed = 2 * rows * (channels + 1)
        if len(data) < needed:
            what = f"has {len(data)} rows, {needed} are needed for {rows} block rows"
            found.append(Problem(f"data set {data.name!r}", what, "Record longer, or lower block_rows"))
    limit = (block_rows - 1) * p
    if order != "auto" and order > limit:
        what = f"is {order}, at most {limit} can be told from {block_rows} block rows"
        found.append(Problem("order", what, "Lower the order, or raise block_rows"))
    return found


def least_block_rows(order: int, outputs: int) -> int:
    """Return the shortest windows whose shift invariance determines so many states."""
    return max(2, -(-order // outputs) + 1)


def excitation(inputs: Array) -> float:
    """Return the smallest eigenvalue of the unit-diagonal covariance of stacked inputs.

    With states in the data, the rank condition [X; U] = n + s m (thesis eq. 3.71) needs it to be positive.

    Args:
        inputs: Covariance of windows of inputs, shape (depth m, depth m).
    """
    if not np.all(np.diag(inputs) > 0.0):
        return 0.0
    scale = np.sqrt(np.diag(inputs))
    unit = inputs / np.outer(scale, scale)
    return max(float(scipy.linalg.eigvalsh(unit, subset_by_index=(0, 0))[0]), 0.0)


def refuse_unexcited(smallest: float, depth: int) -> None:
    """Refuse inputs that do not excite `depth` samples in a row.

    Raises:
        IdentificationError: `smallest`, from `excitation`, is zero within rounding.
    """
    if smallest < _EXCITED:
        what = f"do not excite {depth} samples in a row (smallest eigenvalue {smallest:.1e}, eq. 3.71)"
        mend = "Use inputs with noise or steps at random times, independent of each other"
        raise IdentificationError.of("inputs", what, mend)

"""Standard errors of the physical theta: the way from data to theta gone again without a tenth of the data.

The physical theta does not minimise a cost over the operating-point data (it comes by way of a black-box
model and its frequency response), so no Hessian tells how sure it is. The delete-a-group jackknife
(Quenouille 1956; Tukey 1958) needs nothing but the way itself, and groups that are long against the
correlation of the errors keep it honest where the errors are not noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.data_set import DataSet
from identification.n4sid import LocalModels, by_centre
from identification.subspace import estimate
from identification.surrogate.chain import Head
from identification.surrogate.frequency_response import FrequencyResponseSettings, fit_frequency_response
from identification.surrogate.structure import Structure

GROUPS = 10
"""Groups of rows, each left out once: a standard error is then known to a quarter of itself."""


def physical_errors(
    local: LocalModels,
    operating_points: Sequence[DataSet],
    spectrum: Array,
    structure: Structure,
    head: Head,
    settings: FrequencyResponseSettings,
) -> Array:
    """Return the standard errors of the physical theta, (M, P), each in its parameter's unit.

    NaN at a bound, and for local models of which a part of the data gives no model.

    Args:
        local: The local models and the settings they came from; orders and block rows are kept.
        operating_points: The data they came from.
        spectrum: As for the fit of theta itself (`fit_frequency_response`).
        structure: Which chain.
        head: The collector head.
        settings: Of the fit.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Data that do not belong to the local models.
    """
    groups = by_centre(operating_points, local.settings)
    found = np.full((len(local.models), len(structure.parameters)), np.nan)
    for index, (model, experiments) in enumerate(zip(local.models, groups, strict=True)):
        chosen = local.settings.subspace.model_copy(
            update={"order": model.order, "block_rows": model.diagnostics["block_rows"]}
        )
        thetas = []
        for group in range(GROUPS):
            parts = [part for data in experiments for part in _without(data, group)]
            try:
                again = estimate(parts, local.settings.inputs, local.settings.outputs, chosen)
                thetas.append(fit_frequency_response(again, spectrum, structure, head, settings).theta)
            except IdentificationError:
                break
        if len(thetas) == GROUPS:
            search = structure.to_search(np.array(thetas))
            errors = np.sqrt((GROUPS - 1) ** 2 / GROUPS) * search.std(axis=0, ddof=1)
            whole = fit_frequency_response(model, spectrum, structure, head, settings).theta
            held = structure.at_bound(whole)
            free = np.array([name not in held for name in structure.names])
            found[index] = np.where(free, errors * structure.slope(whole), np.nan)
    return found


def _without(data: DataSet, group: int) -> list[DataSet]:
    """Return the rows before and after a group, those that are long enough to count."""
    edges = np.linspace(0, len(data), GROUPS + 1).round().astype(int)
    first, last = int(edges[group]), int(edges[group + 1])
    pieces = [(0, first), (last, len(data))]
    return [
        DataSet(f"{data.name} {a}..{b}", data.sample_time, data.names, data.units, data.values[a:b])
        for a, b in pieces
        if b > a
    ]

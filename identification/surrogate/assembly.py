"""From an identified surrogate to a parameter set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from fmu_builder.kernel import Chain
from fmu_builder.parameter_set import (
    DerivedOutput,
    NodeTable,
    Offsets,
    ParameterSet,
    nested,
)
from identification.blending import as_parts, blended, stacked
from identification.network import assemble
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_NAMES, STATE_NAMES
from identification.surrogate.result import SurrogateResult, Which


def network(
    name: str,
    result: SurrogateResult,
    derived_outputs: Sequence[DerivedOutput] = (),
    which: Which | None = None,
    **rest: Any,
) -> ParameterSet:
    """Return the parameter set of a surrogate.

    Args:
        name: C identifier; the FMU's default model identifier.
        result: From `identify`.
        derived_outputs: F_H and F_p.
        which: Theta the local models are made of; default the recommended one.
        rest: Further fields of the parameter set; `provenance` is added to that of the identification.

    Raises:
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    theta: Which = which or result.recommended
    inputs, outputs = result.local.signals
    provenance = {
        **result.local.provenance,
        **result.provenance,
        "theta": theta,
        **rest.pop("provenance", {}),
    }
    settings = result.settings.network()
    parameter_set = assemble(
        name,
        result.local_models(theta),
        result.partition(theta),
        settings.model_copy(update={"offsets": "scheduled_equilibrium"}),
        (
            tuple(next(one for one in inputs if one.name == wanted) for wanted in INPUT_NAMES),
            tuple(next(one for one in outputs if one.name == wanted) for wanted in OUTPUT_NAMES),
        ),
        result.local.static_map,
        derived_outputs,
        kind="surrogate",
        surrogate=result.parameters(),
        provenance=provenance,
        trained_region=result.local.region(derived_outputs),
        **rest,
    )
    if result.settings.offsets == "affine":
        return _with_affine_offsets(parameter_set, result, theta)
    if result.settings.blending == "theta":
        return parameter_set.replaced(blending="theta", node_table=theta_nodes(result, theta))
    return parameter_set


def theta_nodes(result: SurrogateResult, which: Which) -> NodeTable:
    """Return the node table of a theta blend: at every node theta is blended, then discretised.

    By the C that an FMU runs when somebody changes theta in there.

    Raises:
        ParameterSetError: A node does not come to rest.
    """
    blend = result.frame.theta_blend
    if blend is None:
        raise ValueError("this surrogate blends matrices")
    shares = blend.shares(result.parameters_of(which).warp)
    chain = Chain(
        result.structure.name,
        asdict(result.head),
        result.theta(which),
        shares,
        result.local.models[0].sample_time,
    )
    return NodeTable(positions=nested(blend.positions), weights=nested(shares), models=chain.models())


def _with_affine_offsets(parameter_set: ParameterSet, result: SurrogateResult, which: Which) -> ParameterSet:
    """Return the network with the estimated offsets of eq. 3.33-3.34 in place of the static map."""
    inputs = len(INPUT_NAMES)
    parts = [
        model.model_copy(
            update={
                "g": None,
                "x0": nested(np.zeros(len(STATE_NAMES))),
                "u0": nested(row[:inputs]),
                "y0": nested(row[inputs:]),
            }
        )
        for model, row in zip(parameter_set.local_models, result.parameters_of(which).offsets, strict=True)
    ]
    table = parameter_set.node_table
    if table is not None:
        models = as_parts(blended(stacked(parts), np.array(table.weights)))
        table = NodeTable(positions=table.positions, weights=table.weights, models=models)
    return parameter_set.replaced(local_models=tuple(parts), node_table=table, offsets=Offsets(kind="affine"))

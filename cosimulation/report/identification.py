"""The page on one identification: what was chosen and why, singular values, local models."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from cosimulation.report.bands import model_tables
from cosimulation.report.choices import ORDER_RULE, choice_rows
from cosimulation.report.figures.singular_values import singular_values_figure
from cosimulation.report.surrogate import surrogate_table
from cosimulation.report.template import rendered
from identification.n4sid import LocalModels

if TYPE_CHECKING:
    from cosimulation.identify import Identified


def identification_page(result: Identified) -> str:
    """Return the page on an identification: self-contained, the same text for the same result."""
    local, chosen = result.local, result.parameter_set
    provenance = {
        name: value for name, value in chosen.provenance.items() if name not in ("choices", "warnings")
    }
    return rendered(
        "identification.html.jinja",
        name=chosen.name,
        headline=result.headline,
        model_hash=chosen.model_hash(),
        warnings=result.warnings,
        choices=choice_rows(result.choices),
        rule=ORDER_RULE,
        figure=Markup(singular_values_figure(local, "local")),
        reduced=any("hankel_singular_values" in model.diagnostics for model in local.models),
        method=local.settings.subspace.method,
        outputs=local.settings.outputs,
        rows=_local_rows(local),
        surrogate=None
        if result.surrogate is None
        else surrogate_table(chosen.name, result.surrogate, "surrogate"),
        bands=model_tables(chosen),
        bands_remark=result.bands_remark,
        provenance=json.dumps(provenance, indent=1, sort_keys=True),
    )


def _local_rows(local: LocalModels) -> list[dict[str, Any]]:
    """Return what the table says of every local model."""
    rows = []
    for index, model in enumerate(local.models):
        found = model.diagnostics
        excitation = found["excitation"]
        rows.append(
            {
                "place": local.place(index),
                "samples": found["rows"],
                "order": model.order,
                "block_rows": found["block_rows"],
                "seen": found["seen_block_rows"],
                "excitation": f"{excitation['smallest_eigenvalue']:.2g}",
                "depth": excitation["samples_in_a_row"],
                "radius": f"{model.spectral_radius:.6f}",
                "fits": ["at rest" if fit is None else f"{fit:.3f}" for fit in found["training_fit"]],
            }
        )
    return rows

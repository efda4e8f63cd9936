"""Small networks whose stability can be worked out by hand, with certificates."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fmu_builder.parameter_set import ParameterSet, StabilityCertificate, nested

Array = NDArray[np.float64]
Content = dict[str, Any]


def blend(
    models: Sequence[Any], positions: Sequence[float], sample_time: float = 1.0, blending: str = "parameter"
) -> ParameterSet:
    """A network of these matrices A at the nodes; with output blending they are the local models."""
    parts = [part(np.atleast_2d(np.array(A, dtype=float))) for A in models]
    output = blending == "output"
    local = parts if output else [parts[0], parts[-1]]
    nodes = [positions[0], positions[-1]] if output else list(positions)
    shares = np.linspace(0.0, 1.0, len(nodes))
    weights = [[1.0 - w, *[0.0] * (len(local) - 2), w] for w in shares.tolist()]
    return ParameterSet(
        name="certified",
        kind="n4sid",
        sample_time=sample_time,
        inputs=[
            {"name": "s", "unit": "m", "operating_point": positions[0], "minimum": -9.0, "maximum": 9.0},
            {"name": "load", "unit": "N", "operating_point": 0.0, "minimum": -1.0, "maximum": 1.0},
        ],
        outputs=[{"name": "y", "unit": "m", "operating_point": 0.0, "minimum": -1.0, "maximum": 1.0}],
        partition={
            "scheduling": "s",
            "range": (nodes[0], nodes[-1]),
            "validity": "hat",
            "centres": positions if output else (nodes[0], nodes[-1]),
        },
        blending=blending,
        local_models=local,
        node_table={"positions": nodes, "weights": weights, "models": [] if output else parts},
        offsets={
            "kind": "scheduled_equilibrium",
            "static_map": {"positions": nodes, "values": [[0.0]] * len(nodes)},
        },
        declared_unstable=True,
        scores=[{"signal": "y", "split": "test", "fit": 97.25}],
    )


def part(A: Array) -> dict[str, Any]:
    """A local model with two inputs and one output."""
    n = len(A)
    B = np.column_stack([np.zeros(n), np.arange(1.0, n + 1.0)])
    matrices = {"A": A, "B": B, "C": np.ones((1, n)), "D": np.zeros((1, 2)), "g": np.zeros(n)}
    return {name: nested(matrix) for name, matrix in matrices.items()}


def oscillators(nodes: int = 5, damping: float = 0.1) -> ParameterSet:
    """Three states: an oscillator of 3 Hz that becomes one of 2.4 Hz over two metres, and a lag."""
    models = []
    for frequency in np.linspace(3.0, 2.4, nodes):
        omega = 2.0 * np.pi * frequency
        rates = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2.0 * damping * omega, 3.0], [0.5, 0.0, -2.0]])
        models.append(scipy.linalg.expm(0.01 * rates))
    return blend(models, np.linspace(0.5, 2.5, nodes).tolist(), 0.01)


def certificate_of(
    parameter_set: ParameterSet, P: Sequence[Any], rate: float | None, **fields: Any
) -> Content:
    """The content of a parameter set with a certificate; unchecked."""
    table = parameter_set.node_table
    certificate = {
        "model_hash": parameter_set.model_hash(),
        "method": "nodes",
        "rate": rate,
        "decay": 0.0,
        "positions": list(table.positions) if table is not None else [],
        "matrices": [np.atleast_2d(np.array(one, dtype=float)).tolist() for one in P],
        "exclusion": None,
        **fields,
    }
    return {**json.loads(parameter_set.canonical_json()), "certificate": certificate}


def with_certificate(parameter_set: ParameterSet, content: Content) -> ParameterSet:
    """The parameter set with the certificate of `content`."""
    return parameter_set.replaced(certificate=StabilityCertificate(**content["certificate"]))

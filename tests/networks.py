"""Random networks for the tests: stable, asymmetric, no two sizes equal."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_builder.parameter_set import ParameterSet, nested

Array = NDArray[np.float64]
LOW, HIGH = 0.5, 2.5
STATES, OUTPUTS = 5, 3
OFFSETS = ("none", "affine", "low_pass", "scheduled_equilibrium")
BLENDINGS = ("output", "parameter", "theta")
VALIDITIES = ("gaussian", "hat")
VARIANTS = [
    variant for variant in product(OFFSETS, BLENDINGS, VALIDITIES) if variant[1:] != ("theta", "gaussian")
]


def stable_matrix(random: np.random.Generator) -> Array:
    """A full, asymmetric matrix with spectral radius 0.95."""
    matrix = random.standard_normal((STATES, STATES))
    return matrix * (0.95 / np.abs(np.linalg.eigvals(matrix)).max())


def local_model(random: np.random.Generator, offsets: str, inputs: int, feedthrough: bool) -> dict[str, Any]:
    A = stable_matrix(random)
    B = random.standard_normal((STATES, inputs))
    D = random.standard_normal((OUTPUTS, inputs)) * feedthrough
    if offsets == "scheduled_equilibrium":
        D[:, 1] = 0.0
    model = {"A": A, "B": B, "C": random.standard_normal((OUTPUTS, STATES)), "D": D}
    if offsets == "affine":
        sizes = {"x0": STATES, "u0": inputs, "y0": OUTPUTS}
        model |= {name: random.standard_normal(size) for name, size in sizes.items()}
    if offsets == "scheduled_equilibrium":
        model["g"] = np.linalg.solve(np.eye(STATES) - A, B[:, 1])
    return {name: nested(array) for name, array in model.items()}


def node_table(random: np.random.Generator, blending: str, models: int, make: Any) -> dict[str, Any]:
    positions = np.array([LOW, 0.7, 1.1, 1.9, 2.2, HIGH])
    weights = random.uniform(-0.2, 1.0, (positions.size, models))
    weights[:, -1] = 1.0 - weights[:, :-1].sum(axis=1)
    nodes = [] if blending == "output" else [make() for _ in positions]
    return {"positions": nested(positions), "weights": nested(weights), "models": nodes}


def network(
    seed: int,
    offsets: str = "scheduled_equilibrium",
    blending: str = "parameter",
    validity: str = "gaussian",
    feedthrough: bool = True,
    inputs: int = 3,
    models: int = 4,
) -> ParameterSet:
    """A random network; the scheduling input is the second one."""
    random = np.random.default_rng(seed)

    def make() -> dict[str, Any]:
        return local_model(random, offsets, inputs, feedthrough)

    centres = np.sort(random.uniform(LOW, HIGH, models))
    content: dict[str, Any] = {
        "name": "random_network",
        "kind": "n4sid",
        "sample_time": 1e-3,
        "inputs": [
            {"name": f"u_{i}", "unit": "m", "operating_point": 1.3 + 0.1 * i, "minimum": -2.0, "maximum": 4.0}
            for i in range(inputs)
        ],
        "outputs": [
            {"name": f"y_{i}", "unit": "N", "operating_point": 0.3 * i, "minimum": -9.0, "maximum": 9.0}
            for i in range(OUTPUTS)
        ],
        "partition": {
            "scheduling": "u_1",
            "range": [LOW, HIGH],
            "validity": validity,
            "centres": nested(centres),
        },
        "blending": blending,
        "local_models": [make() for _ in range(models)],
        "offsets": {"kind": offsets},
        "derived_outputs": [
            {
                "name": "force",
                "unit": "N",
                "terms": [
                    {"signal": "y_2", "parameter": "stiffness", "sign": 1},
                    {"signal": "u_1", "parameter": "stiffness", "sign": -1},
                ],
                "parameters": {"stiffness": {"value": 50000.0, "unit": "N/m"}},
            },
            {
                "name": "sum",
                "unit": "N",
                "terms": [{"signal": "y_0", "parameter": "one"}, {"signal": "y_1", "parameter": "two"}],
                "parameters": {"one": {"value": 1.0, "unit": "1"}, "two": {"value": 2.5, "unit": "1"}},
            },
        ],
    }
    if validity == "gaussian":
        content["partition"] |= {"spreads": nested(random.uniform(0.3, 0.7, models)), "k_sigma": 0.42}
    else:
        content["node_table"] = node_table(random, blending, models, make)
    if offsets == "low_pass":
        content["offsets"]["corner_frequency"] = 0.25
    if offsets in ("low_pass", "scheduled_equilibrium"):
        positions = np.sort(random.uniform(LOW + 0.2, HIGH - 0.2, 7))
        values = random.standard_normal((7, OUTPUTS))
        content["offsets"]["static_map"] = {"positions": nested(positions), "values": nested(values)}
    return ParameterSet(**content)


def inputs_of(seed: int, count: int, width: int) -> Array:
    """Inputs that wander over the range and beyond both ends, with jumps."""
    random = np.random.default_rng(seed)
    rows = 1.5 + 0.3 * random.standard_normal((count, width))
    rows[:, 1] = 1.5 + 1.6 * np.sin(np.linspace(0.3, 9.0, count)) + 0.02 * random.standard_normal(count)
    return rows

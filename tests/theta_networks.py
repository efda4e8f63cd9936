"""Surrogates whose theta is blended, made by hand: every structure, asymmetric, with a static map."""

from __future__ import annotations

import numpy as np

from fmu_builder.kernel import CHAINS, Chain
from fmu_builder.parameter_set import (
    DerivedOutput,
    DerivedTerm,
    InputSignal,
    NamedParameter,
    NodeTable,
    Offsets,
    OutputSignal,
    ParameterSet,
    Partition,
    Quantity,
    StaticMap,
    SurrogateParameters,
    nested,
)

HEAD = {"m_C": 5.6, "k_C": 10384.8, "c_C": 32.0, "k_E": 1e5}
HEAD_UNITS = {"m_C": "kg", "k_C": "N/m", "c_C": "N.s/m", "k_E": "N/m"}
BASE = {
    **{"m_H": 8.0, "m_M": 14.0, "k_L": 25343.9, "c_L": 25.0, "r_M": 0.3, "k_W": 1200.0, "c_W": 30.0},
    **{"m_C": 6.1, "k_C": 9000.0, "c_C": 21.0, "b_M": 1.7, "b_H": -0.2, "c_H": 4.0},
}
LOW, HIGH = 0.5, 2.5
CENTRES = (0.75, 1.25, 1.75, 2.25)


def theta_of(structure: str, seed: int = 7) -> np.ndarray:
    """Parameters of four local models, every one another."""
    base = np.array([BASE[one.name] for one in CHAINS[structure]])
    theta: np.ndarray = base * np.random.default_rng(seed).uniform(0.7, 1.4, (len(CENTRES), base.size))
    return theta


def shares_of(positions: np.ndarray) -> np.ndarray:
    """Weights of the local models, cubic over the centres: some are negative, rows sum to 1."""
    columns = []
    for k, centre in enumerate(CENTRES):
        others = [other for index, other in enumerate(CENTRES) if index != k]
        columns.append(np.prod([(positions - o) / (centre - o) for o in others], axis=0))
    return np.column_stack(columns)


REST = (("xi", "m", 1.5), ("xi_dot", "m/s", 0.0), ("zeta", "m", 1.51), ("zeta_dot", "m/s", 0.0))


def _output(name: str, unit: str, at: float) -> OutputSignal:
    return OutputSignal(name=name, unit=unit, operating_point=at, minimum=-3.0, maximum=3.0)


def _force(name: str, *terms: tuple[str, str, int]) -> DerivedOutput:
    rows = tuple(DerivedTerm(signal=s, parameter=p, sign=sign) for s, p, sign in terms)  # type: ignore[arg-type]
    named = {p: NamedParameter(value=HEAD[p], unit=HEAD_UNITS[p]) for p in {p for _, p, _ in terms}}
    return DerivedOutput(name=name, unit="N", terms=rows, parameters=named)


def theta_network(
    structure: str = "chain8", nodes: int = 21, gain: float = 0.0, uneven: float = 0.0, seed: int = 7
) -> ParameterSet:
    """A surrogate of four local models whose forces at rest rise with the height, `uneven` N to and fro."""
    theta = theta_of(structure, seed)
    positions = np.linspace(LOW, HIGH, nodes)
    positions[1:-1] += 0.003 * np.sin(7.0 * positions[1:-1])
    weights = shares_of(positions)
    chain = Chain(structure, HEAD, theta, weights, 1e-3)
    local = Chain(structure, HEAD, theta, np.eye(len(CENTRES)), 1e-3)
    heights = np.linspace(LOW, HIGH, 11)
    xi = heights + (66.0 + 3.0 * heights + uneven * (-1.0) ** np.arange(11)) / HEAD["k_E"]
    rest = np.column_stack([xi, 0.0 * xi, xi + 0.01, 0.0 * xi])
    names = [one.name for one in CHAINS[structure]]
    rows = tuple(dict(zip(names, row.tolist(), strict=True)) for row in theta)
    other = tuple({name: value * 1.01 for name, value in row.items()} for row in rows)
    head = (("zeta", "k_C", 1), ("xi", "k_C", -1), ("zeta_dot", "c_C", 1), ("xi_dot", "c_C", -1))
    return ParameterSet(
        name="theta_network",
        kind="surrogate",
        sample_time=1e-3,
        inputs=(
            InputSignal(name="eta", unit="m", operating_point=1.5, minimum=0.4, maximum=2.6),
            InputSignal(name="M_pa", unit="N.m", operating_point=1310.9, minimum=1000.0, maximum=1700.0),
        ),
        outputs=tuple(_output(*one) for one in REST),
        partition=Partition(
            scheduling="eta",
            range=(LOW, HIGH),
            validity="cubic",
            centres=CENTRES,
            deviation_output="zeta" if gain else None,
            deviation_gain=gain,
        ),
        blending="theta",
        local_models=local.models(),
        node_table=NodeTable(positions=nested(positions), weights=nested(weights), models=chain.models()),
        offsets=Offsets(
            kind="scheduled_equilibrium",
            static_map=StaticMap(positions=nested(heights), values=nested(rest)),
        ),
        derived_outputs=(_force("F_H", *head), _force("F_p", ("xi", "k_E", 1), ("eta", "k_E", -1))),
        surrogate=SurrogateParameters(
            structure=structure,  # type: ignore[arg-type]
            head={name: Quantity(value=value, unit=HEAD_UNITS[name]) for name, value in HEAD.items()},
            physical=other,
            tuned=rows,
            units={one.name: one.unit for one in CHAINS[structure]},
        ),
        scores=({"signal": "F_p", "fit": 90.0},),
    )


def inputs_of(count: int, seed: int = 3) -> np.ndarray:
    """Wire and torque that move through half the range."""
    random = np.random.default_rng(seed)
    time = np.arange(count) * 1e-3
    eta = 1.4 + 0.5 * np.sin(6.0 * time) + 1e-3 * random.standard_normal(count)
    return np.column_stack([eta, 1310.9 + 150.0 * np.sin(21.0 * time + 0.3)])

"""The compiled output-error recursion: cost, gradient and Gauss-Newton matrix in one pass.

The equations are those of the kernel with parameter and theta blending, for scheduled equilibrium and affine
offsets; `c/output_error.c` states them.
"""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmu_builder.compiler import load_native
from fmu_builder.errors import IdentificationError
from identification.arrays import Array

_SOURCE = Path(__file__).parent / "c" / "output_error.c"
_SIZES = (
    *("count", "models", "local_models", "states", "others", "observed", "rank", "parameters"),
    *("input_offsets", "output_offsets", "nodes", "deviation_state", "common", "gain_column"),
)
_ARRAYS = (
    *("A", "B", "g", "dA", "dB", "dg", "shares", "directions", "offsets", "start", "start_slope"),
    *("observation", "weight", "factor", "positions", "scheduling", "input", "blend", "target"),
)
_START_PASSES = 100
_Pointer = ctypes.POINTER(ctypes.c_double)


class _Problem(ctypes.Structure):
    """`Problem` of the C file, field by field."""

    _fields_ = [
        *((name, ctypes.c_long) for name in _SIZES),
        ("gain", ctypes.c_double),
        *((name, _Pointer) for name in _ARRAYS),
    ]


def _none() -> Array:
    return np.zeros((0, 0))


@dataclass(frozen=True)
class BlendedModels:
    """K models that are interpolated, with derivatives to the parameters of the M local models behind them.

    Without `positions` they are the local models and the experiment brings their weights; with `positions`
    they are nodes with straight lines in between.

    Attributes:
        A: System matrices, (K, n, n).
        B: Columns of the inputs that do not schedule, (K, n, o).
        g: Equilibrium state per unit of the scheduling input, (K, n); zero where it is not scheduled.
        dA, dB, dg: Derivatives, parameter last: (K, n, n, P), (K, n, o, P), (K, n, P). P may be 0.
        shares: How much of each local model a model is: a parameter of local model i moves model a by
            share_ai dA_a, (K, M); default: model a is local model a.
        positions: Scheduling variable at the nodes, ascending, (K,).
        gain: kappa: the scheduling variable is the scheduling input + kappa * deviation of a state.
        deviation_state: That state.
        directions: How the common parameters move the parameters of each model, (K, common, P).
        gain_column: Whether kappa is a parameter, the last one.
        input_offsets: u0 of every local model, subtracted from the inputs, (M, o) or (0, 0) for none.
        output_offsets: y0 of every local model, added to the first states as observed, (M, p) or (0, 0).
    """

    A: Array
    B: Array
    g: Array
    dA: Array
    dB: Array
    dg: Array
    shares: Array = field(default_factory=_none)
    positions: Array = field(default_factory=lambda: np.zeros(0))
    gain: float = 0.0
    deviation_state: int = 0
    directions: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    gain_column: bool = False
    input_offsets: Array = field(default_factory=_none)
    output_offsets: Array = field(default_factory=_none)

    def __post_init__(self) -> None:
        if self.shares.size == 0:
            object.__setattr__(self, "shares", np.eye(len(self.A)))
        if self.directions.size == 0:
            object.__setattr__(self, "directions", np.zeros((len(self.A), 0, self.dA.shape[-1])))

    @classmethod
    def without_slopes(cls, A: Array, B: Array, g: Array) -> BlendedModels:
        """Return models without parameters: for plain simulation."""
        dA, dB, dg = (np.zeros((*matrix.shape, 0)) for matrix in (A, B, g))
        return cls(A, B, g, dA, dB, dg)

    @property
    def plain(self) -> BlendedModels:
        """The same models without derivatives."""
        dA, dB, dg = (np.zeros((*matrix.shape, 0)) for matrix in (self.A, self.B, self.g))
        return replace(self, dA=dA, dB=dB, dg=dg, directions=np.zeros((0, 0, 0)), gain_column=False)

    @property
    def offsets(self) -> Array:
        """Input and output offsets beside each other, (M, Q)."""
        parts = [one for one in (self.input_offsets, self.output_offsets) if one.size]
        return np.hstack(parts) if parts else np.zeros((self.shares.shape[1], 0))

    @property
    def columns(self) -> int:
        """How many parameters: M (P + Q), the common ones, and kappa."""
        per_model = self.dA.shape[-1] + self.offsets.shape[1]
        return int(self.shares.shape[1] * per_model + self.directions.shape[1]) + self.gain_column

    def weights_at(self, scheduling: float) -> tuple[Array, Array]:
        """Return the weights of the nodes (K,) at a scheduling variable, and their slopes."""
        low, high = self.positions[0], self.positions[-1]
        r = min(max(scheduling, low), high)
        cell = int(np.clip(np.searchsorted(self.positions, r, side="right") - 1, 0, len(self.positions) - 2))
        width = self.positions[cell + 1] - self.positions[cell]
        weights, slopes = np.zeros(len(self.positions)), np.zeros(len(self.positions))
        weights[cell + 1] = (r - self.positions[cell]) / width
        weights[cell] = 1.0 - weights[cell + 1]
        if r == scheduling:
            slopes[[cell, cell + 1]] = -1.0 / width, 1.0 / width
        return weights, slopes


@dataclass(frozen=True)
class Observation:
    """What of the state is observed, and how much each signal counts.

    Attributes:
        matrix: E, (q, n): signals are z = E x, deviations from the scheduled equilibrium.
        weight: Weight of each squared residual in the cost, (q,).
    """

    matrix: Array
    weight: Array

    @functools.cached_property
    def factor(self) -> Array:
        """R with R'R = E' diag(weight) E and as few rows as its rank: enough for J'J."""
        _, singular, rows = np.linalg.svd(np.sqrt(self.weight)[:, None] * self.matrix, full_matrices=False)
        kept = singular > 1e-14 * singular.max(initial=0.0)
        triangular = np.linalg.qr(singular[kept, None] * rows[kept], mode="r")
        factor: Array = np.where(np.abs(triangular) < 1e-15 * np.abs(triangular).max(), 0.0, triangular)
        return factor


@dataclass(frozen=True)
class Experiment:
    """Data of one experiment as the recursion wants them.

    Attributes:
        scheduling: Scheduling input, (N,).
        inputs: The other inputs less their operating points, (N, o).
        blend: Weight of each model at each row, (N, K); not looked at where the models are nodes.
        target: What z should be, (N, q): measured signals less everything that does not depend on the state.
    """

    scheduling: Array
    inputs: Array
    blend: Array
    target: Array


@dataclass(frozen=True)
class Pass:
    """Result of one pass; parameters are ordered model by model (dynamics, u0, y0), then the common ones.

    Attributes:
        cost: Weighted sum of squared residuals.
        gradient: J'r with J = d z / d parameters, (columns,); empty without sensitivities.
        gram: J'J, (columns, columns); empty without sensitivities.
        simulated: z, (N, q); empty unless asked for.
        jacobian: J itself without weights, (N, q, columns); empty unless asked for.
        blocks: J'r of every whole block of rows by itself, (blocks, columns); empty unless asked for.
    """

    cost: float
    gradient: Array
    gram: Array
    simulated: Array
    jacobian: Array
    blocks: Array


def equilibrium(models: BlendedModels, experiment: Experiment) -> tuple[Array, Array]:
    """Return the steady state (n,) for the first inputs, and the slopes (n, columns) of what is observed."""
    scheduled, inputs = float(experiment.scheduling[0]), experiment.inputs[0]
    weights, slopes = np.asarray(experiment.blend[0] if experiment.blend.size else 0.0), None
    state = np.zeros(models.A.shape[1])
    for _ in range(_START_PASSES):
        before = state[models.deviation_state]
        if models.positions.size:
            weights, slopes = models.weights_at(scheduled + models.gain * before)
        A, B = np.tensordot(weights, models.A, 1), np.tensordot(weights, models.B, 1)
        owned = weights @ models.shares
        u = inputs - owned @ models.input_offsets if models.input_offsets.size else inputs
        rest = np.eye(A.shape[0]) - A
        state = np.linalg.solve(rest, B @ u)
        if models.gain == 0.0 or state[models.deviation_state] == before:
            break
    forcing = np.einsum("arcp,c->arp", models.dA, state) + np.einsum("arcp,c->arp", models.dB, u)
    parts = [np.einsum("a,am,arp->rmp", weights, models.shares, forcing)]
    if models.input_offsets.size:
        parts.append(-np.einsum("m,ro->rmo", owned, B))
    if models.output_offsets.size:
        parts.append(np.zeros((len(state), len(owned), models.output_offsets.shape[1])))
    common = np.einsum("a,acp,arp->rc", weights, models.directions, forcing)
    moved = np.hstack([np.concatenate(parts, axis=2).reshape(len(state), -1), common])
    if slopes is not None and (models.gain != 0.0 or models.gain_column):
        rate = np.tensordot(slopes, models.A, 1) @ state + np.tensordot(slopes, models.B, 1) @ u
        rest[:, models.deviation_state] -= models.gain * rate
        if models.gain_column:
            moved = np.column_stack([moved, rate * state[models.deviation_state]])
    start_slope = np.linalg.solve(rest, moved)
    for entry in range(models.output_offsets.shape[1]):
        per_model = models.dA.shape[-1] + models.offsets.shape[1]
        first = models.dA.shape[-1] + models.input_offsets.shape[1] + entry
        start_slope[entry, first::per_model][: len(owned)] = owned
    return np.asarray(state, dtype=np.float64), np.asarray(start_slope)


def run(
    models: BlendedModels,
    experiment: Experiment,
    observation: Observation,
    sensitivities: bool = False,
    simulate: bool = False,
    jacobian: bool = False,
    block_rows: int = 0,
) -> Pass:
    """Simulate one experiment from the steady state of its first inputs, and compare it with the target.

    Args:
        models: What is interpolated.
        experiment: Data.
        observation: What is compared, and with which weights.
        sensitivities: Whether gradient and Gauss-Newton matrix are wanted (about ten times the work).
        simulate: Whether the simulated signals are wanted.
        jacobian: Whether the Jacobian is wanted, N * q * columns numbers; implies `sensitivities`.
        block_rows: Rows of a block whose J'r is wanted; 0 for none; implies `sensitivities`.

    Returns:
        The pass; if the simulation is no longer finite, its cost is infinite and the rest is not to be used.

    Raises:
        IdentificationError: Arrays that do not fit together, or more states or signals than the recursion
            holds.
        BuildError: The recursion cannot be compiled.
    """
    wanted = sensitivities or jacobian or block_rows > 0
    if not wanted:
        models = models.plain
    arrays, sizes = _prepared(models, experiment, observation)
    problem = _Problem(
        *(sizes[name] for name in _SIZES),
        models.gain,
        *(arrays[name].ctypes.data_as(_Pointer) for name in _ARRAYS),
    )
    columns, shape = models.columns, arrays["target"].shape
    library = _library()
    scratch = np.empty(library.output_error_scratch(ctypes.byref(problem)))
    simulated = np.empty(shape if simulate else (0, shape[1]))
    slopes = np.empty((*shape, columns) if jacobian else (0, shape[1], columns))
    blocks = np.zeros((shape[0] // block_rows if block_rows else 0, columns))
    gradient, gram, cost = np.zeros(columns), np.zeros((columns, columns)), ctypes.c_double()
    status = library.output_error(
        ctypes.byref(problem),
        scratch.ctypes.data_as(_Pointer),
        simulated.ctypes.data_as(_Pointer) if simulate else None,
        ctypes.byref(cost),
        *(array.ctypes.data_as(_Pointer) if wanted else None for array in (gradient, gram)),
        slopes.ctypes.data_as(_Pointer) if jacobian else None,
        blocks.ctypes.data_as(_Pointer) if block_rows else None,
        block_rows,
    )
    if status < 0:
        what = "has more states or signals than the compiled recursion holds"
        raise IdentificationError.of("output error", what, "Raise MAXIMUM_STATES and MAXIMUM_OBSERVED")
    value = cost.value if status == 0 else float("inf")
    by_block = np.diff(blocks, axis=0, prepend=0.0)
    return Pass(value, gradient, np.triu(gram) + np.triu(gram, 1).T, simulated, slopes, by_block)


def _prepared(
    models: BlendedModels, experiment: Experiment, observation: Observation
) -> tuple[dict[str, Array], dict[str, int]]:
    """Return arrays and sizes as the compiled recursion wants them."""
    given = {name: getattr(models, name) for name in ("A", "B", "g", "dA", "dB", "dg", "shares", "positions")}
    given["directions"] = models.directions
    given |= {"offsets": models.offsets, "observation": observation.matrix, "weight": observation.weight}
    given |= {"factor": observation.factor, "scheduling": experiment.scheduling, "input": experiment.inputs}
    given |= {"blend": experiment.blend, "target": experiment.target}
    sizes = _sizes(given, models)
    given["start"], given["start_slope"] = equilibrium(models, experiment)
    return {name: np.ascontiguousarray(given[name], dtype=np.float64) for name in _ARRAYS}, sizes


def _sizes(arrays: dict[str, Array], models: BlendedModels) -> dict[str, int]:
    """Return the sizes; raises IdentificationError unless every array has the shape they say."""
    count, observed = arrays["target"].shape
    kinds, states, others, parameters = arrays["dB"].shape
    local_models, rank = arrays["shares"].shape[1], arrays["factor"].shape[0]
    nodes = models.positions.size > 0
    shapes: dict[str, tuple[int, ...]] = {
        **{"A": (kinds, states, states), "B": (kinds, states, others), "g": (kinds, states)},
        **{"dA": (kinds, states, states, parameters), "dg": (kinds, states, parameters)},
        **{"observation": (observed, states), "weight": (observed,), "factor": (rank, states)},
        **{"scheduling": (count,), "input": (count, others), "shares": (kinds, local_models)},
        **{"offsets": (local_models, arrays["offsets"].shape[1])},
        **{"directions": (kinds, arrays["directions"].shape[1], parameters)},
        **({"positions": (kinds,)} if nodes else {"blend": (count, kinds)}),
    }
    wrong = [
        f"{name} has shape {arrays[name].shape}, not {shape}"
        for name, shape in shapes.items()
        if arrays[name].shape != shape
    ]
    if models.input_offsets.size and models.input_offsets.shape[1] != others:
        wrong.append(f"input_offsets have {models.input_offsets.shape[1]} columns, not {others}")
    if nodes and kinds < 2:
        wrong.append("nodes are fewer than two")
    if (models.gain != 0.0 or models.gain_column) and (not nodes or models.offsets.size):
        wrong.append("a deviation that schedules needs nodes, and no offsets of local models")
    if wrong or count == 0:
        what = "; ".join(wrong) or "has no rows"
        raise IdentificationError.of(
            "output error", what, "Give arrays that belong to the same models and data"
        )
    offsets = models.input_offsets.shape[1], models.output_offsets.shape[1]
    values = (count, kinds, local_models, states, others, observed, rank, parameters, *offsets)
    rest = int(nodes), models.deviation_state, arrays["directions"].shape[1], int(models.gain_column)
    return dict(zip(_SIZES, (*values, *rest), strict=True))


@functools.cache
def _library() -> ctypes.CDLL:
    """Return the compiled recursion."""
    library = load_native("output_error", _SOURCE)
    library.output_error_scratch.restype = ctypes.c_long
    library.output_error_scratch.argtypes = [ctypes.POINTER(_Problem)]
    library.output_error.restype = ctypes.c_long
    library.output_error.argtypes = [ctypes.POINTER(_Problem), *[_Pointer] * 7, ctypes.c_long]
    return library

"""The compiled output-error recursion: cost, gradient and Gauss-Newton matrix in one pass.

The equations are those of the kernel's scheduled equilibrium with parameter blending; `c/output_error.c`
states them.
"""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmu_builder.compiler import load_native
from fmu_builder.errors import IdentificationError
from identification.arrays import Array

_SOURCE = Path(__file__).parent / "c" / "output_error.c"
_SIZES = ("count", "models", "states", "others", "observed", "rank", "parameters")
_ARRAYS = (
    *("A", "B", "g", "dA", "dB", "dg", "start", "start_slope"),
    *("observation", "weight", "factor", "scheduling", "input", "blend", "target"),
)
_Pointer = ctypes.POINTER(ctypes.c_double)


class _Problem(ctypes.Structure):
    """`Problem` of the C file, field by field."""

    _fields_ = [*((name, ctypes.c_long) for name in _SIZES), *((name, _Pointer) for name in _ARRAYS)]


@dataclass(frozen=True)
class BlendedModels:
    """Local models in scheduled-equilibrium form, with derivatives to the P parameters of each.

    Attributes:
        A: System matrices, (M, n, n).
        B: Columns of the inputs that do not schedule, (M, n, o).
        g: Equilibrium state per unit of the scheduling input, (M, n).
        dA, dB, dg: Derivatives, parameter last: (M, n, n, P), (M, n, o, P), (M, n, P). P may be 0.
    """

    A: Array
    B: Array
    g: Array
    dA: Array
    dB: Array
    dg: Array

    @classmethod
    def without_slopes(cls, A: Array, B: Array, g: Array) -> BlendedModels:
        """Return models without parameters: for plain simulation."""
        return cls(A, B, g, *(np.zeros((*matrix.shape, 0)) for matrix in (A, B, g)))


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
        blend: Weight of each model at each row, (N, M).
        target: What z should be, (N, q): measured signals less everything that does not depend on the state.
    """

    scheduling: Array
    inputs: Array
    blend: Array
    target: Array


@dataclass(frozen=True)
class Pass:
    """Result of one pass; parameters are ordered model by model.

    Attributes:
        cost: Weighted sum of squared residuals.
        gradient: J'r with J = d z / d parameters, (M P,); empty without sensitivities.
        gram: J'J, (M P, M P); empty without sensitivities.
        simulated: z, (N, q); empty unless asked for.
    """

    cost: float
    gradient: Array
    gram: Array
    simulated: Array


def equilibrium(models: BlendedModels, weights: Array, inputs: Array) -> tuple[Array, Array]:
    """Return the steady state (n,) of the blended model for constant inputs (o,), and its slopes (n, M P)."""
    A, B = np.tensordot(weights, models.A, 1), np.tensordot(weights, models.B, 1)
    state = np.linalg.solve(np.eye(A.shape[0]) - A, B @ inputs)
    forcing = np.einsum("mrcp,c->rmp", models.dA, state) + np.einsum("mrcp,c->rmp", models.dB, inputs)
    slopes = (weights[None, :, None] * forcing).reshape(A.shape[0], -1)
    start_slope: Array = np.linalg.solve(np.eye(A.shape[0]) - A, slopes)
    return np.asarray(state, dtype=np.float64), start_slope


def run(
    models: BlendedModels,
    experiment: Experiment,
    observation: Observation,
    sensitivities: bool = False,
    simulate: bool = False,
) -> Pass:
    """Simulate one experiment from the steady state of its first inputs, and compare it with the target.

    Args:
        models: Local models.
        experiment: Data.
        observation: What is compared, and with which weights.
        sensitivities: Whether gradient and Gauss-Newton matrix are wanted (about ten times the work).
        simulate: Whether the simulated signals are wanted.

    Returns:
        The pass; if the simulation is no longer finite, its cost is infinite and the rest is not to be used.

    Raises:
        IdentificationError: Arrays that do not fit together, or more states or signals than the recursion
            holds.
        BuildError: The recursion cannot be compiled.
    """
    if not sensitivities:
        models = BlendedModels.without_slopes(models.A, models.B, models.g)
    start, slopes = equilibrium(models, experiment.blend[0], experiment.inputs[0])
    given = {**vars(models), "start": start, "start_slope": slopes}
    given |= {"observation": observation.matrix, "weight": observation.weight, "factor": observation.factor}
    given |= {"scheduling": experiment.scheduling, "input": experiment.inputs}
    given |= {"blend": experiment.blend, "target": experiment.target}
    arrays = {name: np.ascontiguousarray(given[name], dtype=np.float64) for name in _ARRAYS}
    sizes = _sizes(arrays)
    problem = _Problem(
        *(sizes[name] for name in _SIZES), *(arrays[name].ctypes.data_as(_Pointer) for name in _ARRAYS)
    )
    columns = sizes["models"] * sizes["parameters"]
    library = _library()
    scratch = np.empty(library.output_error_scratch(ctypes.byref(problem)))
    simulated = np.empty(arrays["target"].shape if simulate else (0, sizes["observed"]))
    gradient, gram, cost = np.empty(columns), np.empty((columns, columns)), ctypes.c_double()
    status = library.output_error(
        ctypes.byref(problem),
        scratch.ctypes.data_as(_Pointer),
        simulated.ctypes.data_as(_Pointer) if simulate else None,
        ctypes.byref(cost),
        *(array.ctypes.data_as(_Pointer) if sensitivities else None for array in (gradient, gram)),
    )
    if status < 0:
        what = "has more states or signals than the compiled recursion holds"
        raise IdentificationError.of("output error", what, "Raise MAXIMUM_STATES and MAXIMUM_OBSERVED")
    value = cost.value if status == 0 else float("inf")
    return Pass(value, gradient, np.triu(gram) + np.triu(gram, 1).T, simulated)


def _sizes(arrays: dict[str, Array]) -> dict[str, int]:
    """Return the sizes; raises IdentificationError unless every array has the shape they say."""
    count, observed = arrays["target"].shape
    models, states, others, parameters = arrays["dB"].shape
    rank = arrays["factor"].shape[0]
    shapes: dict[str, tuple[int, ...]] = {
        **{"A": (models, states, states), "B": (models, states, others), "g": (models, states)},
        **{"dA": (models, states, states, parameters), "dg": (models, states, parameters)},
        **{"observation": (observed, states), "weight": (observed,), "factor": (rank, states)},
        **{"scheduling": (count,), "input": (count, others), "blend": (count, models)},
    }
    wrong = [
        f"{name} has shape {arrays[name].shape}, not {shape}"
        for name, shape in shapes.items()
        if arrays[name].shape != shape
    ]
    if wrong or count == 0:
        what = "; ".join(wrong) or "has no rows"
        raise IdentificationError.of(
            "output error", what, "Give arrays that belong to the same models and data"
        )
    return dict(zip(_SIZES, (count, models, states, others, observed, rank, parameters), strict=True))


@functools.cache
def _library() -> ctypes.CDLL:
    """Return the compiled recursion."""
    library = load_native("output_error", _SOURCE)
    library.output_error_scratch.restype = ctypes.c_long
    library.output_error_scratch.argtypes = [ctypes.POINTER(_Problem)]
    library.output_error.restype = ctypes.c_long
    library.output_error.argtypes = [ctypes.POINTER(_Problem), _Pointer, _Pointer, *[_Pointer] * 3]
    return library

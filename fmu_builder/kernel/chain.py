"""Surrogates whose physical parameters may change: from theta to the node table by the C of the FMU."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmu_builder.errors import ParameterSetError, Problem
from fmu_builder.kernel.chain_parameters import (
    CHAIN_INPUTS,
    CHAIN_OUTPUTS,
    CHAIN_STATES,
    CHAINS,
    COEFFICIENTS,
    CONTACT_STIFFNESS,
    HEAD,
    ChainParameter,
)
from fmu_builder.kernel.native import library
from fmu_builder.parameter_set import LocalLinearModel, NodeTable, ParameterSet, StaticMap, nested

Array = NDArray[np.float64]
_SIZES = ("parameters", "local_models", "nodes")
_INDICES = ("coefficients", "logarithmic")
_ARRAYS = ("least", "largest", "weights")
_NO_REST, _UNSTABLE = 1, 2  # CHAIN_... of c/chain.c


class NativeChain(ctypes.Structure):
    """`ChainTables` of c/chain.c, field by field."""

    _fields_ = (
        *((name, ctypes.c_int) for name in _SIZES),
        ("sample_time", ctypes.c_double),
        *((name, ctypes.POINTER(ctypes.c_int)) for name in _INDICES),
        *((name, ctypes.POINTER(ctypes.c_double)) for name in _ARRAYS),
    )


@dataclass(frozen=True)
class Chain:
    """What turns theta into a node table.

    Attributes:
        structure: A key of `CHAINS`.
        head: m_C (kg), k_C (N/m), c_C (N.s/m) and k_E (N/m) by name.
        theta: Parameters of the local models, (M, P).
        weights: Of every local model at the nodes, (K, M).
        sample_time: Ts, s.
    """

    structure: str
    head: Mapping[str, float]
    theta: Array
    weights: Array
    sample_time: float

    @property
    def parameters(self) -> tuple[ChainParameter, ...]:
        """The free parameters of a local model."""
        return CHAINS[self.structure]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of `ChainTables` in c/chain.c."""
        own = self.parameters
        return {
            "coefficients": np.array([COEFFICIENTS.index(one.name) for one in own], dtype=np.int32),
            "logarithmic": np.array([one.scaling == "log" for one in own], dtype=np.int32),
            "least": np.array([one.least for one in own], dtype=np.float64),
            "largest": np.array([one.upper for one in own], dtype=np.float64),
            "weights": np.ascontiguousarray(self.weights, dtype=np.float64),
        }

    @property
    def sizes(self) -> dict[str, int]:
        """P, M and K under their names in c/chain.c."""
        nodes, models = self.weights.shape
        return dict(zip(_SIZES, (len(self.parameters), models, nodes), strict=True))

    def head_values(self) -> Array:
        """Return the head in the order of c/chain.c."""
        return np.array([self.head[name] for name in HEAD], dtype=np.float64)

    def models(self) -> tuple[LocalLinearModel, ...]:
        """Return the discrete-time model at every node.

        Raises:
            ParameterSetError: A node has no state of rest, or does not come to rest.
        """
        nodes, states, inputs = len(self.weights), len(CHAIN_STATES), len(CHAIN_INPUTS)
        A, B = np.empty((nodes, states, states)), np.empty((nodes, inputs, states))
        g, node = np.empty((nodes, states)), ctypes.c_int()
        arrays, native = self.arrays(), NativeChain(**self.sizes, sample_time=self.sample_time)
        for names, kind in ((_INDICES, ctypes.c_int), (_ARRAYS, ctypes.c_double)):
            for name in names:
                setattr(native, name, arrays[name].ctypes.data_as(ctypes.POINTER(kind)))
        given = (self.head_values(), np.ascontiguousarray(self.theta, dtype=np.float64), A, B, g)
        pointers = (ctypes.c_void_p(array.ctypes.data) for array in given)
        answer = library().llmn_chain_table(ctypes.byref(native), *pointers, ctypes.byref(node))
        if answer:
            what = "is unstable" if answer == _UNSTABLE else "has no state of rest: its springs hold nothing"
            raise ParameterSetError.of(f"node {node.value + 1}", what, "Choose other physical parameters")
        C, D = nested(np.eye(len(CHAIN_OUTPUTS), states)), nested(np.zeros((len(CHAIN_OUTPUTS), inputs)))
        return tuple(
            LocalLinearModel(A=nested(a.T), B=nested(b.T), C=C, D=D, g=nested(rest))
            for a, b, rest in zip(A, B, g, strict=True)
        )


def chain_of(parameter_set: ParameterSet) -> Chain | None:
    """Return what the node table of a surrogate is made of, None where nothing gives just this table.

    Theta must be blended about a scheduled equilibrium. Of the two thetas of a surrogate that one is taken
    whose node table is that of the parameter set, to the last bit.
    """
    surrogate, table = parameter_set.surrogate, parameter_set.node_table
    signals = tuple(signal.name for signal in (*parameter_set.inputs, *parameter_set.outputs))
    if surrogate is None or table is None or parameter_set.blending != "theta":
        return None
    if parameter_set.offsets.kind != "scheduled_equilibrium" or signals != (*CHAIN_INPUTS, *CHAIN_OUTPUTS):
        return None
    names = [one.name for one in CHAINS[surrogate.structure]]
    for local in sorted((surrogate.physical, surrogate.tuned), key=lambda one: one is surrogate.physical):
        if any(set(names) != set(row) for row in local) or set(surrogate.head) != set(HEAD):
            continue
        theta = np.array([[row[name] for name in names] for row in local])
        head = {name: surrogate.head[name].value for name in HEAD}
        chain = Chain(surrogate.structure, head, theta, np.array(table.weights), parameter_set.sample_time)
        if len(theta) == chain.weights.shape[1] and not _outside(chain) and chain.models() == table.models:
            return chain
    return None


def with_parameters(
    parameter_set: ParameterSet, theta: ArrayLike | None = None, contact_stiffness: float | None = None
) -> ParameterSet:
    """Return a surrogate with other physical parameters: what its FMU becomes when they are changed in there.

    Scores and certainty are left out: they belong to the parameters that were identified.

    Args:
        parameter_set: A surrogate whose theta is blended.
        theta: Parameters of the local models, (M, P), default as they are.
        contact_stiffness: k_E, N/m, default as it is. At rest the frame keeps its place where the force is
            the same, so the static map moves along the height.

    Raises:
        ParameterSetError: Not such a surrogate, parameters outside their limits, or models that do not come
            to rest.
    """
    before = chain_of(parameter_set)
    surrogate = parameter_set.surrogate
    if before is None or surrogate is None or parameter_set.node_table is None:
        what = "has no physical parameters that its node table is made of"
        raise ParameterSetError.of("surrogate", what, "Give a surrogate whose theta is blended")
    values = before.theta if theta is None else np.array(theta, dtype=np.float64)
    stiffness = before.head[CONTACT_STIFFNESS] if contact_stiffness is None else float(contact_stiffness)
    if values.shape != before.theta.shape:
        what = f"has shape {values.shape}, not {before.theta.shape}"
        raise ParameterSetError.of("theta", what, "Give one row per local model")
    head = {**before.head, CONTACT_STIFFNESS: stiffness}
    after = Chain(before.structure, head, values, before.weights, before.sample_time)
    if problems := _outside(after):
        raise ParameterSetError(problems)
    local = Chain(before.structure, head, values, np.eye(len(values)), before.sample_time)
    rows = tuple({one.name: float(v) for one, v in zip(after.parameters, row, strict=True)} for row in values)
    known = {"value": stiffness}
    quantity = surrogate.head[CONTACT_STIFFNESS].model_copy(update=known)
    changed = surrogate.model_copy(
        update={
            "head": {**surrogate.head, CONTACT_STIFFNESS: quantity},
            "tuned": rows,
            "recommended": "tuned",
            "reason": "changed after identification",
            "certainty": None,
            "at_bound": (),
        }
    )
    offsets = parameter_set.offsets.model_copy(
        update={"static_map": _moved(parameter_set, before.head[CONTACT_STIFFNESS] / stiffness)}
    )
    table = parameter_set.node_table
    return parameter_set.replaced(
        local_models=local.models(),
        node_table=NodeTable(positions=table.positions, weights=table.weights, models=after.models()),
        offsets=offsets,
        derived_outputs=tuple(_with_stiffness(one, known) for one in parameter_set.derived_outputs),
        surrogate=changed,
        scores=(),
    )


def _with_stiffness(derived: Any, known: Mapping[str, float]) -> Any:
    parameters = dict(derived.parameters)
    if CONTACT_STIFFNESS in parameters:
        parameters[CONTACT_STIFFNESS] = parameters[CONTACT_STIFFNESS].model_copy(update=known)
    return derived.model_copy(update={"parameters": parameters})


def _moved(parameter_set: ParameterSet, ratio: float) -> StaticMap | None:
    """Return the static map for another contact stiffness, `ratio` being the old one over the new one."""
    known = parameter_set.offsets.static_map
    if known is None or ratio == 1.0:
        return known
    positions, values = np.array(known.positions), np.ascontiguousarray(known.values, dtype=np.float64)
    moved = np.empty_like(positions)
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (positions, values))
    sizes = (ctypes.c_int(values.shape[1]), ctypes.c_int(len(positions)), ctypes.c_double(ratio))
    if library().llmn_chain_map_positions(*pointers, *sizes, ctypes.c_void_p(moved.ctypes.data)):
        what = "is so soft that the wire would have to fall for the frame to rise at rest"
        raise ParameterSetError.of(CONTACT_STIFFNESS, what, "Give a stiffer spring")
    return known.model_copy(update={"positions": nested(moved)})


def _outside(chain: Chain) -> Sequence[Problem]:
    """Return what lies outside its limits."""
    problems = [
        Problem(
            f"{one.name}[{row + 1}]", f"is {value!r}", f"Give a number from {one.lower!r} to {one.upper!r}"
        )
        for row, numbers in enumerate(chain.theta.tolist())
        for one, value in zip(chain.parameters, numbers, strict=True)
        if not one.lower <= value <= one.upper
    ]
    for name, value in chain.head.items():
        if not (np.isfinite(value) and value > 0.0):
            problems.append(Problem(name, f"is {value!r}", "Give a finite number greater than zero"))
    return problems

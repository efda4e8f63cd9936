"""Model reduction in balanced coordinates: truncation and residualisation, discrete time (thesis 3.5.3).

python-control reduces continuous-time models only, and only with slycot; hence the square-root method here
(Laub et al. 1987; singular perturbation: Liu and Anderson 1989).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.local_model import LocalModel

Reduction = Literal["truncation", "residualisation"]

_REACHABLE = 1e-8
"""Hankel singular value over the largest that Gramians in double precision still tell from zero."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """x+ = A x + B u, y = C x + D u of fewer states, and all Hankel singular values of the original."""

    A: Array
    B: Array
    C: Array
    D: Array
    hankel_singular_values: Array


def balanced_reduction(A: Array, B: Array, C: Array, D: Array, order: int, method: Reduction) -> Reduced:
    """Return a model of `order` states, stable like the original.

    With X = S S', Y = R R' the controllability and observability Gramians and R' S = U Sigma V', the
    projections are T = S V1 Sigma1^(-1/2) and W = R U1 Sigma1^(-1/2). The error in the frequency response is
    at most 2 sum(truncated sigma) (Glover 1984). Residualisation sets the weak balanced states to rest
    (x2+ = x2) and keeps the static gain.

    Args:
        A: Stable state matrix, shape (n, n).
        B: Shape (n, m).
        C: Shape (p, n).
        D: Shape (p, m).
        order: States to keep, below n.
        method: "truncation" or "residualisation".

    Raises:
        IdentificationError: The order is not 1 .. n - 1, or beyond what inputs reach and outputs show.
    """
    root_x, root_y = _gramian_roots(A, B, C)
    U, sigma, Vt = scipy.linalg.svd(root_y.T @ root_x)
    kept = int(np.sum(sigma > _REACHABLE * sigma[0]))
    most = min(kept, len(A) - 1)
    if not 1 <= order <= most:
        what = f"is {order}; of the {len(A)} states to reduce {kept} are reachable and observable"
        mend = f"Give 1 .. {most}" if most else "Give a model whose inputs move its outputs"
        raise IdentificationError.of("reduced order", what, mend)
    # residualisation needs the whole balanced model, as far as it is there in double precision
    size = order if method == "truncation" else kept
    scale = 1.0 / np.sqrt(sigma[:size])
    T, W = root_x @ Vt[:size].T * scale, root_y @ U[:, :size] * scale
    a, b, c = W.T @ A @ T, W.T @ B, C @ T
    if method == "truncation":
        return Reduced(a, b, c, D, sigma)
    strong, weak = slice(0, order), slice(order, None)
    rest = np.linalg.solve(np.eye(size - order) - a[weak, weak], np.hstack([a[weak, strong], b[weak]]))
    from_strong, from_input = rest[:, :order], rest[:, order:]
    return Reduced(
        a[strong, strong] + a[strong, weak] @ from_strong,
        b[strong] + a[strong, weak] @ from_input,
        c[:, strong] + c[:, weak] @ from_strong,
        D + c[:, weak] @ from_input,
        sigma,
    )


def reduced(
    model: LocalModel,
    order: int,
    method: Reduction = "truncation",
    input_scale: Array | None = None,
    output_scale: Array | None = None,
) -> LocalModel:
    """Return a local model of fewer states; `hankel_singular_values` joins its diagnostics.

    Args:
        model: Stable local model.
        order: States to keep; the model itself is returned if it has no more.
        method: "truncation" or "residualisation".
        input_scale: Size of each input, shape (m,); default that in the diagnostics of the estimator, else 1.
        output_scale: Size of each output, shape (p,); likewise.

    Raises:
        IdentificationError: The model is unstable, or the order is too large.
    """
    if order >= model.order:
        return model
    if not model.spectral_radius < 1.0:
        what = f"is unstable (largest |pole| {model.spectral_radius:.6f})"
        raise IdentificationError.of("model to reduce", what, 'Identify it with stabilisation = "reflect"')
    inputs = _scale(input_scale, model.diagnostics.get("input_scale"), len(model.inputs))
    outputs = _scale(output_scale, model.diagnostics.get("output_scale"), len(model.outputs))[:, None]
    found = balanced_reduction(
        model.A, model.B * inputs, model.C / outputs, model.D * inputs / outputs, order, method
    )
    values = found.hankel_singular_values.tolist()
    return replace(
        model,
        A=found.A,
        B=found.B / inputs,
        C=found.C * outputs,
        D=found.D * outputs / inputs,
        diagnostics={**model.diagnostics, "hankel_singular_values": values},
    )


def balancing_transform(model: LocalModel, output_scale: Array | None = None) -> Array | None:
    """Return T that takes a model to its balanced coordinates T x, whatever coordinates it has now.

    They are unique up to signs where the Hankel singular values differ; signs are such that the output that
    shows a state most shows it positive. Inputs count in the sizes the estimator saw, else 1.

    Args:
        model: Local model.
        output_scale: Size of each output, shape (p,); default that in the diagnostics, else 1.

    Returns:
        T, shape (n, n); None where the model is unstable or has states that inputs do not reach or outputs
        do not show.
    """
    if not model.spectral_radius < 1.0:
        return None
    inputs = _scale(None, model.diagnostics.get("input_scale"), len(model.inputs))
    outputs = _scale(output_scale, model.diagnostics.get("output_scale"), len(model.outputs))[:, None]
    root_x, root_y = _gramian_roots(model.A, model.B * inputs, model.C / outputs)
    U, sigma, _ = scipy.linalg.svd(root_y.T @ root_x)
    if not sigma[-1] > _REACHABLE * sigma[0]:
        return None
    transform = (root_y @ U / np.sqrt(sigma)).T
    seen = (model.C / outputs) @ np.linalg.inv(transform)
    most = seen[np.argmax(np.abs(seen), axis=0), np.arange(model.order)]
    return np.asarray(np.where(most < 0.0, -1.0, 1.0)[:, None] * transform)


def _gramian_roots(A: Array, B: Array, C: Array) -> tuple[Array, Array]:
    """Return S and R with S S' and R R' the controllability and observability Gramians."""
    # the other method, SciPy's choice below ten states, suffers from states of different sizes
    reached = scipy.linalg.solve_discrete_lyapunov(A, B @ B.T, method="bilinear")
    shown = scipy.linalg.solve_discrete_lyapunov(A.T, C.T @ C, method="bilinear")
    return _root(reached), _root(shown)


def _scale(given: Array | None, known: list[float] | None, size: int) -> Array:
    chosen = known if given is None else given
    return np.ones(size) if chosen is None else np.asarray(chosen, dtype=np.float64)


def _root(gramian: Array) -> Array:
    """Return S with S S' = gramian; what rounding has made negative counts as zero."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))

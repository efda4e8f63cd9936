"""The small semidefinite programmes behind a certificate: what they find is a guess that `verify` judges.

P(r) is linear between knots, some of the nodes of the table. A condition is the matrix
lambda^2 N(P) - M(P) with N and M linear in the P of the knots; it shall be positive definite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse

from identification.arrays import Array

MOST_KNOTS = 17
"""More change little and cost time."""
_POLYNOMIALS_UP_TO = 24
"""Nodes up to which all Bernstein coefficients are conditions; between closer nodes the ends decide."""
_ITERATIONS = 60
_SHARES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0)
"""Of the largest multiplier: the smaller ones are left out, as long as the proof stands without them."""
_FLOOR = 1e-8
"""Of the largest multiplier: added to the others, which may be singular."""


class Solution(NamedTuple):
    """P at the knots, shape (knots, n, n), at most the identity, and by how much the conditions are kept."""

    P: Array
    margin: float


class Exclusion(NamedTuple):
    """Matrices Z > 0 at some models, shape (count, n, n), with sum A Z A' - Z > 0: there is no common P."""

    nodes: tuple[int, ...]
    Z: Array


class Triangle:
    """Symmetric matrices as vectors, so that the scalar products agree: upper triangle by columns.

    Attributes:
        size: n (n + 1) / 2.
        to_vector: Shape (size, n^2), from the rows of a matrix.
        identity: The identity as a vector.
    """

    def __init__(self, n: int) -> None:
        self.n, self.size = n, n * (n + 1) // 2
        self.to_vector = np.zeros((self.size, n * n))
        for k, (i, j) in enumerate((row, column) for column in range(n) for row in range(column + 1)):
            self.to_vector[k, i * n + j] = self.to_vector[k, j * n + i] = 1.0 if i == j else np.sqrt(0.5)
        self.identity = self.to_vector @ np.eye(n).ravel()

    def matrices(self, vectors: Array) -> Array:
        """Return matrices, shape (..., n, n), of vectors, shape (..., size)."""
        return np.asarray(vectors @ self.to_vector).reshape(*vectors.shape[:-1], self.n, self.n)

    def congruence(self, X: Array, Y: Array) -> Array:
        """Return the map from P to the symmetric part of X' P Y, shape (size, size)."""
        both = np.kron(X.T, Y.T)
        if X is not Y:
            both = 0.5 * (both + np.kron(Y.T, X.T))
        return np.asarray(self.to_vector @ both @ self.to_vector.T)


@dataclass(frozen=True)
class Conditions:
    """Conditions on P at the knots as vectors: N and M, shape (conditions * size, knots * size)."""

    triangle: Triangle
    knots: int
    N: scipy.sparse.csc_matrix
    M: scipy.sparse.csc_matrix

    @property
    def count(self) -> int:
        """Number of conditions."""
        return int(self.N.shape[0]) // self.triangle.size

    def sizes(self, P: Array) -> Array:
        """Return N(P) of P at the knots, shape (count, n, n)."""
        return self._at(self.N, P)

    def shrinkage(self, P: Array) -> float:
        """Return the smallest lambda^2 with which P at the knots keeps all conditions, infinite without."""
        try:
            return max(
                float(scipy.linalg.eigh(left, right, eigvals_only=True)[-1])
                for left, right in zip(self._at(self.M, P), self.sizes(P), strict=True)
            )
        except np.linalg.LinAlgError:  # N(P) is not positive definite
            return np.inf

    def _at(self, side: scipy.sparse.csc_matrix, P: Array) -> Array:
        x = (P.reshape(len(P), -1) @ self.triangle.to_vector.T).ravel()
        return self.triangle.matrices((side @ x).reshape(self.count, -1))


Term = tuple[Array, Array, Array]
"""Shares of the knots, X and Y: sum_q share_q X' P_q Y."""


def conditions(models: Array, positions: Array, move: float, knots: Array) -> Conditions:
    """Return the conditions of a certificate: see `verify`, which lists all of them.

    Within a knot's interval the slope of P is one, so edges count at knots only.

    Args:
        models: A at the nodes, shape (K, n, n).
        positions: The nodes, shape (K,).
        move: d, the longest move per tick.
        knots: Indices of the nodes between which P is linear, the first and the last node among them.
    """
    nodes, widths = len(positions), np.diff(positions)
    share = np.array([np.interp(positions, positions[knots], one) for one in np.eye(len(knots))]).T
    slope = move * np.diff(share, axis=0) / widths[:, None]  # d S_j as shares of the knots
    whole = nodes <= _POLYNOMIALS_UP_TO
    found: list[tuple[Array, list[Term]]] = []

    def at(cell: int, place: float, D: Array) -> tuple[Array, Array, Array]:
        A = (1.0 - place) * models[cell] + place * models[cell + 1]
        P = (1.0 - place) * share[cell] + place * share[cell + 1]
        return A, P, P + D

    def add(cell: int, begin: float, end: float, D: Array, inner: bool) -> None:
        (A0, P0, Q0), (A1, P1, Q1) = at(cell, begin, D), at(cell, end, D)
        found.append((P0, [(Q0, A0, A0)]))
        found.append((P1, [(Q1, A1, A1)]))
        if inner:
            third = 1.0 / 3.0
            found.append((third * (2.0 * P0 + P1), [(third * Q1, A0, A0), (2.0 * third * Q0, A0, A1)]))
            found.append((third * (P0 + 2.0 * P1), [(third * Q0, A1, A1), (2.0 * third * Q1, A0, A1)]))

    for cell in range(nodes - 1):
        for D in (slope[cell], -slope[cell]):
            add(cell, 0.0, 1.0, D, whole)
        part = min(move / widths[cell], 1.0)
        if cell + 2 < nodes and cell + 1 in knots:
            add(cell, 1.0 - part, 1.0, slope[cell + 1], whole)
        if cell > 0 and cell in knots:
            add(cell, 0.0, part, -slope[cell - 1], whole)
    return _assembled(models.shape[1], len(knots), found)


def stein_conditions(models: Array) -> Conditions:
    """Return the conditions on one P for all models, shape (K, n, n)."""
    one = np.ones(1)
    return _assembled(models.shape[1], 1, [(one, [(one, A, A)]) for A in models])


def _assembled(n: int, knots: int, found: Sequence[tuple[Array, list[Term]]]) -> Conditions:
    triangle = Triangle(n)
    size = triangle.size
    N, M = [], []
    seen: set[bytes] = set()
    for shares, terms in found:
        loss = np.zeros((size, knots * size))
        for weights, X, Y in terms:
            inner = triangle.congruence(X, Y)
            for knot in np.flatnonzero(weights):
                loss[:, knot * size : (knot + 1) * size] += weights[knot] * inner
        if (key := shares.tobytes() + loss.tobytes()) in seen:
            continue  # the end of a cell is the beginning of the next one
        seen.add(key)
        N.append(scipy.sparse.kron(shares[None, :], scipy.sparse.identity(size), format="csr"))
        M.append(scipy.sparse.csr_matrix(loss))
    return Conditions(
        triangle, knots, scipy.sparse.vstack(N, format="csc"), scipy.sparse.vstack(M, format="csc")
    )


def largest_margin(asked: Conditions, shrink: float, sample_time: float, scale: Array) -> Solution | None:
    """Maximise t so that lambda^2 N(P) - M(P) >= t Ts scale and P <= 1; None where nothing is positive.

    Args:
        asked: The conditions.
        shrink: lambda^2.
        sample_time: Ts; brings the conditions to order one.
        scale: Positive definite matrices for the conditions, shape (count, n, n), or one for all (n, n).
    """
    triangle, knots = asked.triangle, asked.knots
    margin = np.broadcast_to(scale, (asked.count, triangle.n, triangle.n)).reshape(asked.count, -1)
    column = scipy.sparse.csc_matrix((margin @ triangle.to_vector.T).reshape(-1, 1))
    kept = scipy.sparse.hstack([(asked.M - shrink * asked.N) / sample_time, column])
    bounded = scipy.sparse.identity(knots * triangle.size, format="csc")
    bounded = scipy.sparse.hstack([bounded, scipy.sparse.csc_matrix((bounded.shape[0], 1))])
    right = np.concatenate([np.zeros(kept.shape[0]), np.tile(triangle.identity, knots)])
    answer = _solved(scipy.sparse.vstack([kept, bounded]), right, 0, triangle.n, asked.count + knots)
    if answer is None or not answer[0][-1] > 0.0:
        return None
    return Solution(triangle.matrices(answer[0][:-1].reshape(knots, -1)), float(answer[0][-1]))


def common_solution(models: Array, sample_time: float) -> Solution | Exclusion | None:
    """Return one P for all models, or why there is none; None where the numbers leave it open.

    Maximises t with P - A_k' P A_k >= t Ts and trace P = n. Where t is negative the multipliers Z_k of the
    conditions are the reason: sum A_k Z_k A_k' - Z_k is a positive multiple of the identity.

    Args:
        models: A of the models, shape (K, n, n).
        sample_time: Ts.
    """
    distinct = np.unique(models, axis=0, return_index=True)[1]  # equal ones share a condition
    distinct.sort()
    asked = stein_conditions(models[distinct])
    triangle = asked.triangle
    column = scipy.sparse.csc_matrix(np.tile(triangle.identity, asked.count)[:, None])
    kept = scipy.sparse.hstack([(asked.M - asked.N) / sample_time, column])
    trace = scipy.sparse.csc_matrix(np.append(triangle.identity, 0.0)[None, :])
    right = np.append(float(triangle.n), np.zeros(kept.shape[0]))
    answer = _solved(scipy.sparse.vstack([trace, kept]), right, 1, triangle.n, asked.count)
    if answer is None:
        return None
    x, multipliers = answer
    if x[-1] > 0.0:
        return Solution(triangle.matrices(x[:-1].reshape(1, -1)), float(x[-1]))
    Z = triangle.matrices(multipliers[1:].reshape(asked.count, -1))
    found = _fewest(models[distinct], Z)
    return None if found is None else found._replace(nodes=tuple(distinct[list(found.nodes)].tolist()))


def _fewest(models: Array, Z: Array) -> Exclusion | None:
    """Return the largest of the multipliers, as few as will do, made positive definite; None: none will."""
    traces = np.trace(Z, axis1=1, axis2=2)
    for share in _SHARES:
        nodes = np.flatnonzero(traces > share * traces.max())
        definite = Z[nodes] + _FLOOR * traces.max() * np.eye(models.shape[1])
        A = models[nodes]
        total = (A @ definite @ A.transpose(0, 2, 1) - definite).sum(axis=0)
        if np.linalg.eigvalsh(total)[0] > _FLOOR * traces.max():
            return Exclusion(tuple(nodes.tolist()), definite)
    return None


def _solved(
    matrix: scipy.sparse.spmatrix, right: Array, equalities: int, n: int, cones: int
) -> tuple[Array, Array] | None:
    """Maximise the last variable with right - matrix x in the cones; return x and multipliers.

    Args:
        matrix: Rows of the equalities, then of the cones.
        right: The right-hand side.
        equalities: Number of rows that are equalities.
        n: Size of the matrices in the cones.
        cones: Number of cones of positive semidefinite matrices.
    """
    import clarabel  # slow to load, and needed for a search only

    variables = matrix.shape[1]
    cost = np.zeros(variables)
    cost[-1] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = _ITERATIONS
    settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = 1e-7, 1e-4, 1e-7
    kinds = [clarabel.ZeroConeT(equalities)] if equalities else []
    kinds += [clarabel.PSDTriangleConeT(n) for _ in range(cones)]
    nothing = scipy.sparse.csc_matrix((variables, variables))
    found = clarabel.DefaultSolver(
        nothing, cost, scipy.sparse.csc_matrix(matrix), right, kinds, settings
    ).solve()
    x, z = np.array(found.x), np.array(found.z)
    return (x, z) if bool(np.isfinite(x).all() and np.isfinite(z).all()) else None


def knots_of(nodes: int) -> Array:
    """Return which nodes are knots: all, or `MOST_KNOTS` evenly spread, the ends among them."""
    return np.unique(np.linspace(0, nodes - 1, min(nodes, MOST_KNOTS)).round().astype(int))

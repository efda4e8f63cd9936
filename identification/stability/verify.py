"""Whether a certificate of stability holds: exact integers, standard library only, to be read and run alone.

    python verify.py parameter_set.json        (or an .fmu, which carries its parameter set)

What is claimed. Between the ticks t_n and t_n+1 the deviation x of a network from its present equilibrium
follows x <- A(r_n) x, besides what inputs and the motion of the equilibrium add. r is the scheduling variable
clipped to the range of the node table, so beyond the range it stands still; A is linear between the nodes
c_1 < ... < c_K. Claim: whenever r moves by at most d = rate * Ts per tick, in either direction and with any
reversals, V = x' P(r) x falls below lambda^2 V at every tick, lambda = 1 - decay * Ts. So the free response
decays at least like exp(-decay * t) up to a factor.

Why finitely many matrices prove it. P(r) is the linear interpolation of symmetric P_k > 0 at some nodes, the
first and the last among them, with the slope S_j in cell j = [c_j, c_j+1]. With d no longer than any cell,
r_n+1 lies in the cell of r_n or in one beside it, and P(r_n+1) is a convex combination of P(r_n) + D with

    D = d S_j and D = -d S_j        for r_n anywhere in cell j,
    D = d S_j+1                     for r_n in the upper edge [c_j+1 - d, c_j+1] of cell j,
    D = -d S_j-1                    for r_n in the lower edge [c_j, c_j + d],

the last two only where the slope changes.

lambda^2 P(r) - A(r)' (P(r) + D) A(r) is affine in D, so it suffices that it is positive definite for these.
On each of these intervals it is a cubic polynomial in r with matrix coefficients, which is positive definite
if its four Bernstein coefficients are. A symmetric matrix is positive definite if and only if all its leading
principal minors are positive (Sylvester); they are computed in integers. There is no tolerance and no grid,
and it does not matter how the P_k were found.

Without a rate (methods "common" and "local_models") one P serves all nodes, or each local model whose output
is blended has its own: lambda^2 P - A_k' P A_k > 0 for every A_k (Stein), however r moves.

The other way round, `exclusion` shows that there is no common P: with Z_k > 0 and sum_k (A_k Z_k A_k' - Z_k)
> 0, a P > 0 with P - A_k' P A_k > 0 for all k would make sum_k tr Z_k (P - A_k' P A_k) positive and negative.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from operator import mul
from typing import Any, NamedTuple

NOT_PROVED = (
    "Not proved: accuracy, the real pantograph, any loop through a controller or catenary, faster movement"
    " (monitored at run time), useful output bounds."
)
MOVE_MARGIN = Fraction(2**30 + 1, 2**30)
"""Moves this much longer than rate * Ts are proved, too: a height that moves at the rate may be rounded."""

Matrix = list[list[int]]
Ends = tuple[Matrix, Matrix, Matrix, Matrix, int]
"""A and P at both ends of an interval, and the integer that A is multiplied with."""
Lengths = tuple[list[int], list[int], int]
"""Nodes of A, nodes of P and the longest move, in one unit."""


class NotProvedError(ValueError):
    """The certificate does not prove what it claims, or there is none."""


class Proved(NamedTuple):
    """What has been shown."""

    model_hash: str  # of the model
    method: str  # "nodes", "common" or "local_models"
    rate: float | None  # largest rate of the scheduling variable, its unit per second; None: any movement
    move: float | None  # largest move per tick of the clipped scheduling variable; None: any
    decay: float  # 1/s
    matrices: int  # shown to be positive definite
    common_excluded: bool  # whether it was also shown that no common P exists


def verify(content: Mapping[str, Any]) -> Proved:
    """Prove anew what the certificate in a parameter set claims.

    Args:
        content: The parameter set, as its JSON file holds it.

    Raises:
        NotProvedError: There is no certificate, or it does not prove what it claims.
    """
    certificate = content.get("certificate")
    if certificate is None:
        raise NotProvedError("the parameter set carries no certificate")
    found, named, method = model_hash(content), certificate["model_hash"], certificate["method"]
    if named != found:
        raise NotProvedError(f"the certificate is of the model {named}, this is the model {found}")
    sample_time, decay = exact(content["sample_time"], "sample time"), exact(certificate["decay"], "decay")
    if not (sample_time > 0 and 0 <= decay * sample_time < 1):
        raise NotProvedError(f"a decay of {certificate['decay']!r} 1/s does not go with the sample time")
    models, bits, places = _models(content, method)
    P, _ = _integers(certificate["matrices"], "P")
    _refuse_shapes(P, models, certificate, places)
    shown = [(f"P {k}", one) for k, one in enumerate(P, 1)]
    excluded = _shown_exclusion(certificate["exclusion"], models, bits)
    # lambda^2 P - A' Q A > 0 is weights[0] P - weights[1] (2^bits A)' Q (2^bits A) > 0
    weights = ((1 - decay * sample_time) ** 2 * 4**bits).as_integer_ratio()
    rate, move = certificate["rate"], None
    if method == "nodes":
        # all lengths in whole units, the move rounded up
        unit = Fraction(1, max(2**50, *(place.denominator for place in places)))
        longest = math.ceil(exact(rate, "rate") * sample_time * MOVE_MARGIN / unit)
        nodes, knots = ([int(place / unit) for place in ones] for ones in (places, _positions(certificate)))
        if not 0 < longest <= min(right - left for left, right in pairwise(nodes)):
            raise NotProvedError(f"a rate of {rate!r} is not positive, or crosses more than a cell per tick")
        total = _positive(shown, _polynomials(models, P, (nodes, knots, longest), weights))
        move = math.nextafter(float(longest * unit), 0.0)  # not above it
    else:
        total = _positive(shown, _stein(models, P if method == "local_models" else P * len(models), weights))
    return Proved(found, method, rate, move, certificate["decay"], total, excluded)


def _models(content: Mapping[str, Any], method: str) -> tuple[list[Matrix], int, list[Fraction]]:
    """Return A of all models times a power of two, the exponent of that power, and where they belong."""
    table, blending = content["node_table"], content["blending"]
    if blending == "output":
        if method != "local_models":
            raise NotProvedError(f"outputs are blended: the method is 'local_models', not {method!r}")
        holders, positions = content["local_models"], content["partition"]["centres"]
    else:
        if method not in ("nodes", "common"):
            raise NotProvedError(f"parameters are blended: the method is 'nodes' or 'common', not {method!r}")
        if table is None:
            raise NotProvedError("Gaussians blend parameters without a node table: there is no certificate")
        holders, positions = table["models"], table["positions"]
    models, bits = _integers([holder["A"] for holder in holders], "A")
    places = [exact(position, "position") for position in positions]
    if not models or len(places) != len(models) or any(right <= left for left, right in pairwise(places)):
        raise NotProvedError("the positions of the models do not ascend, or are not one for each")
    states = len(models[0])
    if states == 0 or any(len(A) != states or any(len(row) != states for row in A) for A in models):
        raise NotProvedError("the matrices A are not square and of one size")
    return models, bits, places


def _positions(certificate: Mapping[str, Any]) -> list[Fraction]:
    return [exact(position, "position of P") for position in certificate["positions"]]


def _refuse_shapes(
    P: list[Matrix], models: list[Matrix], certificate: Mapping[str, Any], places: list[Fraction]
) -> None:
    """Refuse matrices P that do not belong to these models one by one, and that are not symmetric."""
    method, positions = certificate["method"], _positions(certificate)
    if method == "nodes":
        ends = len(positions) > 1 and (positions[0], positions[-1]) == (places[0], places[-1])
        ascending = all(left < right for left, right in pairwise(positions))
        fits = ends and ascending and set(positions) <= set(places)
    else:
        fits = positions == (places if method == "local_models" else [])
    if not fits:
        raise NotProvedError("the positions of the matrices P are not those of the models")
    if len(P) != (len(positions) or 1):
        raise NotProvedError(f"there are {len(P)} matrices P, and {len(positions) or 1} are needed")
    if (certificate["rate"] is None) == (method == "nodes"):
        raise NotProvedError("the method 'nodes' needs a rate, and no other method has one")
    _refuse_asymmetry(P, len(models[0]), "P")


def _refuse_asymmetry(matrices: list[Matrix], states: int, name: str) -> None:
    for k, one in enumerate(matrices, 1):
        if len(one) != states or any(len(row) != states for row in one):
            raise NotProvedError(f"{name} {k} is not a matrix of {states} rows and columns")
        if one != transposed(one):
            raise NotProvedError(f"{name} {k} is not symmetric")


def _polynomials(
    models: list[Matrix], P: list[Matrix], lengths: Lengths, weights: tuple[int, int]
) -> Iterator[tuple[str, Matrix]]:
    """Yield the Bernstein coefficients, times positive numbers, of every cell and edge; P stand at knots."""
    nodes, knots, move = lengths
    steps, k = [combined(1, right, -1, left) for left, right in pairwise(P)], 0
    for cell, (low, high) in enumerate(pairwise(nodes)):
        k += low == knots[k + 1]
        begin, end = knots[k], knots[k + 1]
        A, where = models[cell : cell + 2], f"cell {cell + 1}"
        here = [combined(end - x, P[k], x - begin, P[k + 1]) for x in (low, high)]  # times end - begin
        for direction, name in ((1, "moving up"), (-1, "moving down")):
            ends = (A[0], A[1], here[0], here[1], 1)
            yield from _pieces(f"{where} {name}", ends, steps[k], Fraction(direction * move), weights)
        edges = []
        if high == end and k + 2 < len(knots):
            edges.append(("upper edge", (high - move, high), k + 1, move))
        if low == begin and k > 0:
            edges.append(("lower edge", (low, low + move), k - 1, -move))
        for name, places, other, signed in edges:
            part = [combined(high - x, A[0], x - low, A[1]) for x in places]  # times high - low
            here = [combined(end - x, P[k], x - begin, P[k + 1]) for x in places]
            share = Fraction(signed * (end - begin), knots[other + 1] - knots[other])
            ends = (part[0], part[1], here[0], here[1], high - low)
            yield from _pieces(f"{where}, {name}", ends, steps[other], share, weights)


def _pieces(
    where: str, ends: Ends, step: Matrix, share: Fraction, weights: tuple[int, int]
) -> Iterator[tuple[str, Matrix]]:
    """Yield B0, 3 B1, 3 B2, B3 of lambda^2 P - A' (P + share * step) A, times positive numbers."""
    A0, A1, P0, P1, scale = ends
    Q0, Q1 = (combined(share.denominator, end, share.numerator, step) for end in (P0, P1))
    keep, lose = weights[0] * scale**2 * share.denominator, weights[1]
    Q0_A0, Q0_A1, Q1_A0, Q1_A1 = product(Q0, A0), product(Q0, A1), product(Q1, A0), product(Q1, A1)
    left, right = transposed(A0), transposed(A1)
    mixed0, mixed1 = product(left, Q0_A1), product(left, Q1_A1)
    inner0 = combined(1, product(left, Q1_A0), 1, combined(1, mixed0, 1, transposed(mixed0)))
    inner1 = combined(1, product(right, Q0_A1), 1, combined(1, mixed1, 1, transposed(mixed1)))
    yield f"{where}, B0", combined(keep, P0, -lose, product(left, Q0_A0))
    yield f"{where}, B1", combined(keep, combined(2, P0, 1, P1), -lose, inner0)
    yield f"{where}, B2", combined(keep, combined(1, P0, 2, P1), -lose, inner1)
    yield f"{where}, B3", combined(keep, P1, -lose, product(right, Q1_A1))


def _stein(models: list[Matrix], P: list[Matrix], weights: tuple[int, int]) -> Iterator[tuple[str, Matrix]]:
    """Yield lambda^2 P - A' P A of every model, times a positive number."""
    for k, (A, one) in enumerate(zip(models, P, strict=True), 1):
        yield f"model {k}", combined(weights[0], one, -weights[1], product(transposed(A), product(one, A)))


def _shown_exclusion(exclusion: Mapping[str, Any] | None, models: list[Matrix], bits: int) -> bool:
    """Return whether there is a proof that no common P exists; refuse one that fails."""
    if exclusion is None:
        return False
    Z, _ = _integers(exclusion["matrices"], "Z")
    nodes = exclusion["nodes"]
    if not Z or len(nodes) != len(Z) or any(not 0 <= node < len(models) for node in nodes):
        raise NotProvedError("the matrices Z of the exclusion do not belong to nodes one by one")
    states = len(models[0])
    _refuse_asymmetry(Z, states, "Z")
    total = [[0] * states for _ in range(states)]
    for node, one in zip(nodes, Z, strict=True):
        A = models[node]
        grown = combined(1, product(product(A, one), transposed(A)), -(4**bits), one)
        total = combined(1, total, 1, grown)
    _positive([(f"Z {k}", one) for k, one in enumerate(Z, 1)], [("sum of A Z A' - Z", total)])
    return True


def _positive(*groups: Iterable[tuple[str, Matrix]]) -> int:
    """Return how many matrices there are; refuse when one is not positive definite."""
    total, wrong = 0, []
    for group in groups:
        for where, matrix in group:
            total += 1
            if not is_positive_definite(matrix):
                wrong.append(where)
    if wrong:
        what = f"{len(wrong)} of {total} matrices are not positive definite, the first at {wrong[0]}"
        raise NotProvedError(what)
    return total


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether all leading principal minors of a symmetric matrix are positive: the pivots of Bareiss."""
    rows, before = [row[:] for row in matrix], 1
    for k, row in enumerate(rows):
        minor = row[k]
        if minor <= 0:
            return False
        for i in range(k + 1, len(rows)):
            lower, factor = rows[i], rows[i][k]
            for j in range(k + 1, i + 1):
                lower[j] = (lower[j] * minor - factor * rows[j][k]) // before  # without remainder
        before = minor
    return True


def product(left: Matrix, right: Matrix) -> Matrix:
    """Return left times right."""
    columns = transposed(right)
    return [[sum(map(mul, row, column)) for column in columns] for row in left]


def combined(a: int, left: Matrix, b: int, right: Matrix) -> Matrix:
    """Return a left + b right."""
    return [
        [a * x + b * y for x, y in zip(row, other, strict=True)]
        for row, other in zip(left, right, strict=True)
    ]


def transposed(matrix: Matrix) -> Matrix:
    """Return the transpose."""
    return [list(column) for column in zip(*matrix, strict=True)]


def exact(value: Any, name: str) -> Fraction:
    """Return a number of the file as the fraction that the double is."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise NotProvedError(f"{name}: {value!r} is not a finite number")
    return Fraction(value)


def _integers(matrices: Sequence[Any], name: str) -> tuple[list[Matrix], int]:
    """Return matrices times the least power of two that makes them integers, and its exponent."""
    numbers = [[[exact(entry, name) for entry in row] for row in matrix] for matrix in matrices]
    denominators = [entry.denominator for matrix in numbers for row in matrix for entry in row]
    scale = max(denominators, default=1)
    whole = [[[int(entry * scale) for entry in row] for row in matrix] for matrix in numbers]
    return whole, scale.bit_length() - 1


def model_hash(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 (hex) of what the FMU computes with: the identity of the model."""

    def of(items: Sequence[Mapping[str, Any]], *names: str) -> list[dict[str, Any]]:
        return [{name: item[name] for name in names} for item in items]

    derived = of(content["derived_outputs"], "name", "unit", "terms", "parameters")
    for one in derived:
        parameters = one["parameters"].items()
        one["parameters"] = {name: {"value": p["value"], "unit": p["unit"]} for name, p in parameters}
    whole = ("name", "sample_time", "partition", "blending", "local_models", "node_table", "offsets")
    identity = {name: content[name] for name in whole} | {
        "format": 1,
        "inputs": of(content["inputs"], "name", "unit", "operating_point", "minimum", "maximum"),
        "outputs": of(content["outputs"], "name", "unit", "operating_point"),
        "derived_outputs": derived,
    }
    return hashlib.sha256((_canonical(identity, 0) + "\n").encode("utf-8")).hexdigest()


def _canonical(item: Any, depth: int) -> str:
    """Return JSON with sorted keys, one space per level, lists of plain values on one line."""
    if isinstance(item, dict) and item:
        quoted = {key: json.dumps(key, ensure_ascii=False) for key in sorted(item)}
        parts = [f"{text}: {_canonical(item[key], depth + 1)}" for key, text in quoted.items()]
        opening, closing = "{", "}"
    elif isinstance(item, list | tuple) and any(isinstance(part, dict | list | tuple) for part in item):
        parts, opening, closing = [_canonical(part, depth + 1) for part in item], "[", "]"
    else:
        return json.dumps(item, ensure_ascii=False, allow_nan=False)
    inner = ",\n".join(" " * (depth + 1) + part for part in parts)
    return f"{opening}\n{inner}\n{' ' * depth}{closing}"


def statement(content: Mapping[str, Any], proved: Proved) -> str:
    """Return what is proved and how good the model is, on one line: neither is worth much alone."""
    scheduling = content["partition"]["scheduling"]
    unit = next(signal["unit"] for signal in content["inputs"] if signal["name"] == scheduling)
    moving = "" if proved.rate is None else f" moving at most {proved.rate:g} {unit}/s * Ts per sample"
    return (
        f"Proved: the free response from the current equilibrium decays at least like exp(-{proved.decay:g}"
        f" t) up to a factor, for every trajectory of {scheduling}{moving}, in exact arithmetic, for the"
        f" stored numbers; {fit_text(content)}."
    )


def fit_text(content: Mapping[str, Any]) -> str:
    """Return the lowest FIT of every signal among the stored scores, on test data where there are any."""
    scores = [one for one in content.get("scores", ()) if isinstance(one.get("fit"), int | float)]
    scores = [one for one in scores if one.get("split") == "test"] or scores
    worst: dict[str, float] = {}
    for one in scores:
        name = str(one.get("signal"))
        worst[name] = min(one["fit"], worst.get(name, math.inf))
    if not worst:
        return "no FIT is stored with the model"
    return "lowest FIT: " + ", ".join(f"{name} {value:.2f} %" for name, value in worst.items())


def read(path: str) -> Any:
    """Return the JSON of a parameter set, out of an FMU where the file is one."""

    def refuse(text: str) -> None:
        raise NotProvedError(f"{path} holds {text}, which is no number")

    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                text = archive.read("resources/parameter_set.json").decode("utf-8")
        else:
            with open(path, encoding="utf-8") as file:
                text = file.read()
        return json.loads(text, parse_constant=refuse)
    except (OSError, KeyError, UnicodeDecodeError, RecursionError, json.JSONDecodeError) as reason:
        raise NotProvedError(f"{path} holds no parameter set ({reason})") from reason


def main(arguments: Sequence[str]) -> int:
    """Prove every file named; return 1 when one of them cannot be proved."""
    failed = 0
    for path in arguments:
        try:
            content = read(path)
            print(f"{path}: {statement(content, verify(content))}\n{NOT_PROVED}")
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as reason:
            failed, ours = 1, isinstance(reason, NotProvedError)
            print(f"{path}: NOT proved: {reason if ours else f'no certified parameter set ({reason!r})'}")
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

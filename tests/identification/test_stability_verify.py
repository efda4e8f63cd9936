"""What the exact checker proves, and what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import certified_networks as networks
import networks as any_networks
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_builder.parameter_set import ParameterSet
from identification.stability import found_certificate, verify
from identification.stability.verify import NotProvedError

RATE = 4.0
SCRIPT = Path(verify.__file__)


@pytest.fixture(scope="module")
def proved() -> ParameterSet:
    """Oscillators with a certificate that holds."""
    plain = networks.oscillators()
    return plain.replaced(certificate=found_certificate(plain, RATE))


@pytest.fixture
def content(proved: ParameterSet) -> networks.Content:
    return json.loads(proved.canonical_json())


def refused(content: networks.Content) -> str:
    with pytest.raises(NotProvedError) as caught:
        verify.verify(content)
    return str(caught.value)


def test_what_is_proved_is_what_the_certificate_claims(content: networks.Content) -> None:
    found = verify.verify(content)
    assert (found.method, found.rate, found.decay) == ("nodes", RATE, content["certificate"]["decay"])
    assert found.decay > 0.3  # of 1.5 1/s of the slowest oscillator standing still
    assert found.move is not None
    assert 0.0 < found.move / (RATE * 0.01) - 1.0 < 1e-8
    # 4 cells with two directions, 3 upper and 3 lower edges, four coefficients each; five P
    assert found.matrices == (4 * 2 + 3 + 3) * 4 + 5
    assert found.common_excluded == (content["certificate"]["exclusion"] is not None)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_on_no_trajectory_within_the_rate_does_v_shrink_less_than_proved(
    proved: ParameterSet, seed: int
) -> None:
    """Every tick, with reversals, jumps back and forth and moves beyond the ends."""
    random = np.random.default_rng(seed)
    shown = verify.verify(json.loads(proved.canonical_json()))
    assert proved.certificate is not None and proved.node_table is not None and shown.move is not None
    nodes = np.array(proved.node_table.positions)
    A = np.array([model.A for model in proved.node_table.models])
    P = np.array(proved.certificate.matrices)

    def at(stack: Any, r: float) -> Any:
        cell = int(np.clip(np.searchsorted(nodes, r, side="right") - 1, 0, len(nodes) - 2))
        f = (r - nodes[cell]) / (nodes[cell + 1] - nodes[cell])
        return (1.0 - f) * stack[cell] + f * stack[cell + 1]

    height, x = random.uniform(nodes[0] - 0.1, nodes[-1] + 0.1), random.standard_normal(3)
    shrink = (1.0 - shown.decay * proved.sample_time) ** 2
    for move in shown.move * random.choice([-1.0, -0.3, 0.0, 1.0, 1.0], 60):
        r = float(np.clip(height, nodes[0], nodes[-1]))
        height += move
        after = float(np.clip(height, nodes[0], nodes[-1]))
        following = at(A, r) @ x
        assert following @ at(P, after) @ following < shrink * (x @ at(P, r) @ x)
        x = following / np.linalg.norm(following)


@pytest.mark.parametrize("radius", [1.0, 1.0 + 1e-12, 1.2])
@pytest.mark.parametrize("node", [0, 1, 2])
def test_an_unstable_local_model_is_refused(radius: float, node: int) -> None:
    entries = [0.5, 0.5, 0.5]
    entries[node] = radius
    network = networks.blend([np.diag([a, 0.1]) for a in entries], [0.0, 1.0, 2.0])
    for method, P in (("nodes", [np.eye(2)] * 3), ("common", [np.eye(2)])):
        rate = 0.25 if method == "nodes" else None
        positions = [0.0, 1.0, 2.0] if method == "nodes" else []
        claim = networks.certificate_of(network, P, rate, method=method, positions=positions)
        assert "not positive definite" in refused(claim)
    outputs = networks.blend([np.diag([a, 0.1]) for a in entries], [0.0, 1.0, 2.0], blending="output")
    claim = networks.certificate_of(
        outputs, [np.eye(2)] * 3, None, method="local_models", positions=[0.0, 1.0, 2.0]
    )
    assert f"model {node + 1}" in refused(claim)


def test_a_blend_that_is_unstable_only_between_nodes_is_refused() -> None:
    left = np.array([[0.5, 2.0], [0.0, 0.5]])
    assert np.abs(np.linalg.eigvals(0.5 * (left + left.T))).max() == 1.5
    network = networks.blend([left, left.T], [0.0, 1.0])
    # each end alone is fine with its own P, however slowly the height moves
    P = [np.diag([1.0, 9.0]), np.diag([9.0, 1.0])]
    for A, one in zip((left, left.T), P, strict=True):
        assert (np.linalg.eigvalsh(one - A.T @ one @ A) > 0.0).all()
    message = refused(networks.certificate_of(network, P, 1e-6))
    assert ", B1" in message or ", B2" in message


def edges_needed() -> tuple[ParameterSet, networks.Content]:
    """One state; V = P x^2 rises from 0.9 to 1.4, which no condition of a whole cell sees."""
    network = networks.blend([0.99, 0.5, 0.5], [0.0, 1.0, 2.0])
    return network, networks.certificate_of(network, [10.0, 10.0, 69.0], 0.499)


def test_a_certificate_that_passes_without_edge_intervals_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    _, claim = edges_needed()
    message = refused(claim)
    assert "upper edge" in message
    assert message.startswith(("1 of", "2 of", "3 of", "4 of"))  # of the edge alone
    a, after = 0.99 - 0.9 * 0.49, 10.0 + 59.0 * 0.399
    assert a**2 * after > 10.0  # it is indeed no Lyapunov function
    whole = verify._polynomials
    monkeypatch.setattr(
        verify, "_polynomials", lambda *given: (one for one in whole(*given) if "edge" not in one[0])
    )
    assert verify.verify(claim).matrices == 2 * 2 * 4 + 3


def test_the_lower_edge_is_needed_as_well() -> None:
    network = networks.blend([0.5, 0.5, 0.99], [0.0, 1.0, 2.0])
    assert "lower edge" in refused(networks.certificate_of(network, [69.0, 10.0, 10.0], 0.499))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c["matrices"][2][0].__setitem__(1, c["matrices"][2][0][1] + 1.0), "P 3 is not symmetric"),
        (lambda c: c["matrices"].reverse(), "not positive definite"),
        (lambda c: c["matrices"].pop(), "there are 4 matrices P, and 5 are needed"),
        (lambda c: c["matrices"][1].pop(), "P 2 is not a matrix"),
        (lambda c: c["positions"].__setitem__(1, 1.25), "positions of the matrices"),
        (lambda c: c["positions"].pop(), "positions of the matrices"),
        (lambda c: c["positions"].__setitem__(slice(0, 2), [1.0, 0.5]), "positions of the matrices"),
        (lambda c: c.update(positions=c["positions"][:1] * 5), "positions of the matrices"),
        (lambda c: c.update(rate=12.0), "not positive definite"),
        (lambda c: c.update(rate=60.0), "more than a cell per tick"),
        (lambda c: c.update(rate=0.0), "is not positive"),
        (lambda c: c.update(rate=-1.0), "is not positive"),
        (lambda c: c.update(rate=None), "needs a rate"),
        (lambda c: c.update(rate=float("nan")), "not a finite number"),
        (lambda c: c.update(decay=1.4), "not positive definite"),
        (lambda c: c.update(decay=-0.1), "decay"),
        (lambda c: c.update(decay=101.0), "decay"),
        (lambda c: c.update(decay=float("inf")), "not a finite number"),
        (lambda c: c["matrices"][0][0].__setitem__(0, float("nan")), "not a finite number"),
        (lambda c: c["matrices"][0][0].__setitem__(0, True), "not a finite number"),
        (lambda c: c.update(method="common"), "positions of the matrices"),
        (lambda c: c.update(method="local_models"), "parameters are blended"),
        (lambda c: c.update(method="trust me"), "parameters are blended"),
        (
            lambda c: c.update(matrices=[[[-x for x in r] for r in one] for one in c["matrices"]]),
            "not positive",
        ),
    ],
)
def test_a_changed_certificate_is_refused(content: networks.Content, change: Any, says: str) -> None:
    change(content["certificate"])
    assert says in refused(content)


@pytest.mark.parametrize("part", ["A", "position", "sample time", "gain"])
def test_a_changed_model_is_refused_by_its_hash(content: networks.Content, part: str) -> None:
    table = content["node_table"]
    row = table["models"][1]["A"][2]
    if part == "A":
        row[0] = float(np.nextafter(row[0], 1.0))
    elif part == "position":
        table["positions"][1] = 1.0 + 1e-9
    elif part == "sample time":
        content["sample_time"] = 0.0101
    else:
        table["models"][1]["C"][0][0] = 2.0
    assert "the certificate is of the model" in refused(content)


def test_numbers_that_are_none_are_refused_even_under_a_hash_that_fits(
    content: networks.Content, monkeypatch: pytest.MonkeyPatch
) -> None:
    content["node_table"]["models"][1]["A"][0][0] = float("nan")
    monkeypatch.setattr(verify, "model_hash", lambda _: content["certificate"]["model_hash"])
    assert "A: nan is not a finite number" in refused(content)


def test_without_a_certificate_nothing_is_proved(content: networks.Content) -> None:
    content["certificate"] = None
    assert "carries no certificate" in refused(content)


def test_gaussians_that_blend_parameters_have_no_certificate() -> None:
    network = any_networks.network(1, "scheduled_equilibrium", "parameter", "gaussian")
    claim = networks.certificate_of(network, [np.eye(5)], None, method="common", positions=[])
    assert "Gaussians" in refused(claim)


def test_a_proof_that_no_common_p_exists_is_checked_exactly() -> None:
    """Two stable models whose product is not: A1 A2 has the eigenvalue 4."""
    left = np.array([[0.0, 2.0], [0.0, 0.0]])
    network = networks.blend([left, left.T], [0.0, 1.0])
    Z = [np.diag([1.0, 2.0]).tolist(), np.diag([2.0, 1.0]).tolist()]  # A Z A' = diag(8, 0) and diag(0, 8)
    excluded = {"nodes": [0, 1], "matrices": Z}
    claim = networks.certificate_of(
        network, [np.eye(2)], None, method="common", positions=[], exclusion=excluded
    )
    assert "model 1" in refused(claim)  # the exclusion holds, the common P does not
    excluded["matrices"][0][1][1] = 9.0  # 8 - 1 - 2, but 8 - 9 - 1
    assert "sum of A Z A' - Z" in refused(claim)
    excluded["matrices"][0][1][1] = -1.0
    assert "Z 1" in refused(claim)
    excluded["nodes"] = [0, 5]
    assert "do not belong to nodes" in refused(claim)


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.lists(st.lists(st.integers(-30, 30), min_size=n, max_size=n), min_size=n, max_size=n)
    ),
    st.integers(0, 40),
)
@settings(deadline=None)
def test_positive_definite_is_what_sympy_says(rows: list[list[int]], added: int) -> None:
    half = np.array(rows)
    matrix = (half + half.T + added * np.eye(len(rows), dtype=int)).tolist()
    minors = [sympy.Matrix(matrix)[:k, :k].det() for k in range(1, len(matrix) + 1)]
    assert verify.is_positive_definite(matrix) == all(minor > 0 for minor in minors)


@given(st.integers(0, 10**6), st.fractions(0, 1))
@settings(max_examples=25, deadline=None)
def test_the_bernstein_coefficients_are_those_of_the_condition(seed: int, place: Fraction) -> None:
    random = np.random.default_rng(seed)
    A0, A1 = (random.integers(-9, 10, (2, 2)).tolist() for _ in range(2))
    P = [(half + half.T).tolist() for half in random.integers(-9, 10, (3, 2, 2))]
    share, weights, width = Fraction(3, 7), (5, 2), 4
    step = (np.array(P[2]) - np.array(P[1])).tolist()
    A0_wide, A1_wide = ((width * np.array(A)).tolist() for A in (A0, A1))
    pieces = dict(verify._pieces("x", (A0_wide, A1_wide, P[0], P[1], width), step, share, weights))

    def linear(left: Any, right: Any) -> Any:
        return sympy.Matrix(left) * (1 - place) + sympy.Matrix(right) * place

    A, here = linear(A0, A1), linear(P[0], P[1])
    D = sympy.Rational(3, 7) * sympy.Matrix(step)
    condition = width**2 * 7 * (5 * here - 2 * A.T * (here + D) * A)
    powers = [(1 - place) ** 3, (1 - place) ** 2 * place, (1 - place) * place**2, place**3]
    total = sympy.zeros(2, 2)
    for number, power in enumerate(powers):
        total += sympy.Matrix(pieces[f"x, B{number}"]) * power
    assert total == condition


@pytest.mark.parametrize("variant", any_networks.VARIANTS)
def test_the_model_hash_is_the_one_of_the_parameter_set(variant: tuple[str, str, str]) -> None:
    network = any_networks.network(3, *variant)
    assert verify.model_hash(json.loads(network.canonical_json())) == network.model_hash()


def alone(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The checker as a sceptic runs it: without our packages, without any other."""
    return subprocess.run(
        [sys.executable, "-I", "-S", str(SCRIPT), *arguments], capture_output=True, text=True, timeout=60
    )


def test_the_checker_runs_alone(proved: ParameterSet, tmp_path: Path) -> None:
    file = proved.save(tmp_path / "model.json")
    with zipfile.ZipFile(tmp_path / "model.fmu", "w") as archive:
        archive.writestr("resources/parameter_set.json", file.read_text(encoding="utf-8"))
    result = alone(str(file), str(tmp_path / "model.fmu"))
    assert result.returncode == 0, result.stderr
    first = result.stdout.splitlines()[0]
    assert "at most 4 m/s" in first and "FIT" in first and "y 97.25 %" in first
    assert result.stdout.count("Not proved: accuracy") == 2


def test_the_checker_alone_refuses_what_is_no_proof(proved: ParameterSet, tmp_path: Path) -> None:
    text = proved.canonical_json()
    bad = {
        "changed.json": text.replace('"rate": 4.0', '"rate": 12.0'),
        "nan.json": text.replace('"rate": 4.0', '"rate": NaN'),
        "list.json": "[]",
        "text.json": "no json",
        "empty.json": json.dumps({"certificate": {"model_hash": "x"}}),
    }
    for name, content in bad.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    for name in (*bad, "missing.json"):
        result = alone(str(tmp_path / name))
        assert result.returncode == 1
        assert "NOT proved" in result.stdout
        assert result.stderr == ""


def test_the_checker_imports_the_standard_library_only() -> None:
    source = SCRIPT.read_text(encoding="utf-8")
    imported = {
        line.split()[1].split(".")[0] for line in source.splitlines() if line.startswith(("from ", "import "))
    }
    assert imported <= set(sys.stdlib_module_names)

"""exp, log, tanh, sin, cos and sqrt in C against 50 digits of mpmath."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

import fmu_builder
import tolerances
from fmu_builder.compiler import load_native

HERE = Path(__file__).parent
KERNEL = Path(fmu_builder.__file__).parent / "kernel" / "c"
FUNCTIONS = ("exp", "sin", "cos", "log", "tanh", "sqrt")


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    return load_native("test_elementary", HERE / "elementary_host.c", (KERNEL,))


def evaluate(library: ctypes.CDLL, name: str, values: object) -> np.ndarray:
    x = np.ascontiguousarray(values, dtype=np.float64)
    y = np.empty_like(x)
    pointers = (ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(y.ctypes.data))
    library.evaluate(FUNCTIONS.index(name), ctypes.c_longlong(x.size), *pointers)
    return y


def largest_error(name: str, x: np.ndarray, y: np.ndarray) -> float:
    """The largest error in units of the last place of the exact value."""
    with mpmath.workdps(50):
        function = getattr(mpmath, name)
        exact = [function(mpmath.mpf(float(value))) for value in x]
        pairs = zip(exact, y, strict=True)
        return max(float(abs(e - mpmath.mpf(float(v))) / mpmath.mpf(math.ulp(float(e)))) for e, v in pairs)


def samples(low: float, high: float, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(low, high, 4000)


@pytest.mark.parametrize(("low", "high"), [(-1e-3, 1e-3), (-1.0, 1.0), (-40.0, 5.0), (-708.0, 709.0)])
def test_exp_is_within_an_ulp(library: ctypes.CDLL, low: float, high: float) -> None:
    x = samples(low, high, 1)
    assert largest_error("exp", x, evaluate(library, "exp", x)) < tolerances.ELEMENTARY_ULP


@pytest.mark.parametrize(
    ("low", "high"), [(0.6, 1.7), (0.999, 1.001), (1e-9, 1e-3), (1.0, 1e7), (1e300, 1e308)]
)
def test_log_is_within_an_ulp(library: ctypes.CDLL, low: float, high: float) -> None:
    x = samples(low, high, 6)
    assert largest_error("log", x, evaluate(library, "log", x)) < tolerances.ELEMENTARY_ULP


def test_log_at_the_edges_of_its_reduction_and_among_the_smallest_numbers(library: ctypes.CDLL) -> None:
    edges = np.array([2.0 / 3.0, 1.0, 4.0 / 3.0, 2.0, 2.0**-1022, 2.0**-1074, 3.0 * 2.0**-1070])
    x = np.concatenate([edges[:5], np.nextafter(edges[:5], 0.0), np.nextafter(edges[:5], 9.0), edges[5:]])
    x = x[x != 1.0]
    assert largest_error("log", x, evaluate(library, "log", x)) < tolerances.ELEMENTARY_ULP
    assert evaluate(library, "log", [0.0, 1.0, math.inf]).tolist() == [-math.inf, 0.0, math.inf]
    assert np.isnan(evaluate(library, "log", [-1.0, -math.inf, -5e-324])).all()


@pytest.mark.parametrize("high", [1e-300, 1e-9, 0.01, 0.17, 0.35, 0.6, 2.0, 21.9, 30.0])
def test_tanh_is_within_its_ulps_odd_and_never_above_one(library: ctypes.CDLL, high: float) -> None:
    x = samples(-high, high, 7)
    y = evaluate(library, "tanh", x)
    assert largest_error("tanh", x, y) < tolerances.TANH_ULP
    assert np.abs(y).max() <= 1.0
    assert evaluate(library, "tanh", -x).tolist() == (-y).tolist()
    assert evaluate(library, "tanh", [0.0, math.inf, -math.inf, 1e4]).tolist() == [0.0, 1.0, -1.0, 1.0]


@pytest.mark.parametrize("name", ["sin", "cos"])
@pytest.mark.parametrize("high", [1e-3, 0.8, 7.0, 1e3, 1e5])
def test_sine_and_cosine_are_within_an_ulp(library: ctypes.CDLL, name: str, high: float) -> None:
    x = samples(-high, high, 2)
    assert largest_error(name, x, evaluate(library, name, x)) < tolerances.ELEMENTARY_ULP


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_next_to_the_zeros_the_reduction_keeps_its_digits(library: ctypes.CDLL, name: str) -> None:
    multiples = np.arange(-40, 41) * (math.pi / 2)
    x = np.concatenate([multiples, np.nextafter(multiples, 10.0), np.nextafter(multiples, -10.0)])
    assert largest_error(name, x, evaluate(library, name, x)) < tolerances.ELEMENTARY_ULP


def test_square_root_is_correctly_rounded(library: ctypes.CDLL) -> None:
    x = np.concatenate([samples(0.0, 1e-6, 3), samples(0.0, 10.0, 4), samples(0.0, 1e12, 5)])
    assert evaluate(library, "sqrt", x).tolist() == [math.sqrt(value) for value in x]


def test_exact_values_and_the_ends_of_the_range(library: ctypes.CDLL) -> None:
    assert evaluate(library, "exp", [0.0, -1000.0, 1000.0]).tolist() == [1.0, 0.0, math.inf]
    assert evaluate(library, "exp", [-math.inf, math.inf]).tolist() == [0.0, math.inf]
    subnormal = np.array([-710.0, -720.0, -740.0, -745.0])
    assert np.abs(evaluate(library, "exp", subnormal) - np.exp(subnormal)).max() <= 2 * math.ulp(0.0)
    assert evaluate(library, "sin", [0.0]).tolist() == [0.0]
    assert evaluate(library, "cos", [0.0]).tolist() == [1.0]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_number_in_no_number_out(library: ctypes.CDLL, name: str) -> None:
    assert np.isnan(evaluate(library, name, [math.nan])).all()


def test_outside_the_domain_is_not_a_number(library: ctypes.CDLL) -> None:
    assert np.isnan(evaluate(library, "sin", [2e6, -2e6, math.inf])).all()
    assert np.isnan(evaluate(library, "cos", [2e6, -2e6, -math.inf])).all()
    assert np.isnan(evaluate(library, "sqrt", [-1.0, -math.inf])).all()

"""The equalities that hold to the last bit: JSON == tables.h, specification == kernel."""

from __future__ import annotations

import ctypes
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import networks
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tolerances
from fmu_builder.compiler import load_native
from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel import SOURCES, Network, simulate, specification, tables_header, tables_of
from fmu_builder.kernel.native import library
from fmu_builder.kernel.tables import ARRAYS, INDICES, NUMBERS, SIZES, NativeTables, Tables
from fmu_builder.parameter_set import ParameterSet

READER = """
#include "kernel.h"
#include "tables.h"
EXPORTED const Tables *read_tables(void) { return &tables; }
EXPORTED int state_size(void) { return TABLES_STATE_SIZE; }
EXPORTED double sample_time(void) { return TABLES_SAMPLE_TIME; }
"""

variants = st.sampled_from(networks.VARIANTS)


def specified(parameter_set: ParameterSet, inputs: networks.Array) -> networks.Array:
    return np.array(specification.simulate(parameter_set, inputs.tolist()))


def read_back(header: str, folder: Path) -> ctypes.CDLL:
    """The library a compiler makes of a tables.h."""
    (folder / "tables.h").write_text(header, encoding="utf-8")
    (folder / "reader.c").write_text(READER, encoding="utf-8")
    library = load_native("tables_reader", folder / "reader.c", include=(folder, SOURCES))
    library.read_tables.restype = ctypes.POINTER(NativeTables)
    library.sample_time.restype = ctypes.c_double
    return library


def differing_fields(native: NativeTables, tables: Tables) -> list[str]:
    """Names of the fields in which the compiled tables differ from those in Python, by bytes."""
    different = [name for name in SIZES if getattr(native, name) != tables.sizes[name]]
    different += [name for name in NUMBERS if getattr(native, name).hex() != tables.numbers[name].hex()]
    for name in (*ARRAYS, *INDICES):
        expected = tables.arrays[name] if name in ARRAYS else tables.indices[name]
        pointer = getattr(native, name)
        found = bytes(np.ctypeslib.as_array(pointer, expected.shape).tobytes()) if pointer else b""
        different += [name] if found != expected.tobytes() else []
    return different


def numbers_in_json(parameter_set: ParameterSet) -> Iterator[tuple[str, int, float]]:
    """Every matrix entry of the JSON text with the array and position the C code reads it from."""
    content: dict[str, Any] = json.loads(parameter_set.canonical_json())
    table = content["node_table"]
    models = content["local_models"] if content["blending"] == "output" or table is None else table["models"]
    for k, model in enumerate(models):
        for name in "ABCD":
            rows, columns = len(model[name]), len(model[name][0])
            for i in range(rows):
                for j in range(columns):
                    yield name, (k * columns + j) * rows + i, model[name][i][j]
        for name in ("g", "x0", "u0", "y0"):
            for i, value in enumerate(model[name] or ()):
                yield name, k * len(model[name]) + i, value
    for k, weights in enumerate(table["weights"] if table else ()):
        for i, value in enumerate(weights):
            yield "node_weights", k * len(weights) + i, value
    static_map = content["offsets"]["static_map"]
    for k, values in enumerate(static_map["values"] if static_map else ()):
        for i, value in enumerate(values):
            yield "map_values", k * len(values) + i, value


@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_json_equals_the_tables_a_compiler_reads(variant: tuple[str, str, str], tmp_path: Path) -> None:
    parameter_set = networks.network(11, *variant)
    tables = tables_of(parameter_set)
    compiled = read_back(tables_header(tables), tmp_path)
    native = compiled.read_tables().contents
    assert differing_fields(native, tables) == []
    numbers = list(numbers_in_json(parameter_set))
    for name, position, value in numbers:
        assert getattr(native, name)[position].hex() == value.hex(), (name, position)
    assert len(numbers) >= 4 * (25 + 15 + 15 + 9)
    assert compiled.sample_time() == parameter_set.sample_time
    assert (
        compiled.state_size() == library().llmn_state_size(ctypes.byref(tables.native())) == tables.state_size
    )


def test_fewer_digits_would_be_seen(tmp_path: Path) -> None:
    tables = tables_of(networks.network(11))
    header = tables_header(tables)
    for value in tables.arrays["A"]:
        header = header.replace(repr(float(value)), f"{value:.15g}")
    compiled = read_back(header, tmp_path)
    assert differing_fields(compiled.read_tables().contents, tables) == ["A"]


@settings(max_examples=60, deadline=None)
@given(variants, st.booleans(), st.integers(2, 3), st.integers(3, 4), st.integers(0, 2**32 - 1))
def test_specification_equals_kernel(
    variant: tuple[str, str, str], feedthrough: bool, inputs: int, models: int, seed: int
) -> None:
    parameter_set = networks.network(seed, *variant, feedthrough, inputs, models)
    rows = networks.inputs_of(seed, 30, inputs)
    assert np.abs(simulate(parameter_set, rows) - specified(parameter_set, rows)).max() == tolerances.BITS


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_every_variant_of_the_specification_equals_the_kernel(
    variant: tuple[str, str, str], feedthrough: bool
) -> None:
    parameter_set = networks.network(23, *variant, feedthrough)
    rows = networks.inputs_of(3, 120, 3)
    kernel = simulate(parameter_set, rows)
    assert np.abs(kernel - specified(parameter_set, rows)).max() == tolerances.BITS
    assert np.ptp(kernel, axis=0).min() > 0.1  # something happens in every column


def test_weights_and_states_of_specification_and_kernel_are_the_same() -> None:
    for variant in networks.VARIANTS:
        parameter_set = networks.network(5, *variant)
        kernel, oracle = Network(parameter_set), specification.Network(parameter_set)
        rows = networks.inputs_of(5, 20, 3)
        kernel.start(rows[0])
        oracle.start(rows[0].tolist())
        for row in rows:
            kernel.tick(row)
            oracle.tick(row.tolist())
            assert kernel.weights.tolist() == oracle.weights
            assert np.atleast_2d(kernel.states).tolist() == oracle.x
            assert kernel.outputs(row).tolist() == oracle.outputs(row.tolist())


@given(st.floats(-800.0, 800.0) | st.floats(-1e-300, 1e-300))
def test_the_exponential_in_python_is_near_the_true_one(x: float) -> None:
    expected = math.exp(x) if x < 709.0 else None
    if expected is not None:
        assert math.isclose(specification.exponential(x), expected, rel_tol=1e-15, abs_tol=1e-323)


def test_the_exponential_has_the_bits_of_the_c_code(tmp_path: Path) -> None:
    source = '#include "elementary.c"\nEXPORTED double run(double x) { return elementary_exp(x); }\n'
    (tmp_path / "run.c").write_text(source)
    compiled = load_native("exponential", tmp_path / "run.c", include=(SOURCES,))
    compiled.run.restype, compiled.run.argtypes = ctypes.c_double, [ctypes.c_double]
    random = np.random.default_rng(1)
    special = [0.0, -0.0, 710.0, 711.0, -745.2, -746.0, -747.0, 1e-320, math.inf, -math.inf]
    for x in (
        *random.uniform(-745.0, 709.0, 3000).tolist(),
        *random.uniform(-2.0, 2.0, 3000).tolist(),
        *special,
    ):
        assert compiled.run(x).hex() == specification.exponential(x).hex(), x
    assert math.isnan(compiled.run(math.nan)) and math.isnan(specification.exponential(math.nan))


def test_a_model_without_a_steady_state_is_refused_by_both() -> None:
    content = networks.network(1, "none", "output").model_dump()
    identity = [[float(i == j) for j in range(5)] for i in range(5)]
    content["local_models"][2]["A"] = identity
    parameter_set = ParameterSet(**content | {"declared_unstable": True})
    rows = networks.inputs_of(1, 3, 3)
    for run in (lambda: simulate(parameter_set, rows), lambda: specified(parameter_set, rows)):
        with pytest.raises(ParameterSetError, match="steady state"):
            run()


@pytest.mark.parametrize("rows", [np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3), np.full((2, 3), np.nan)])
def test_inputs_that_do_not_fit_are_refused(rows: networks.Array) -> None:
    with pytest.raises(ValueError, match="inputs"):
        simulate(networks.network(1), rows)

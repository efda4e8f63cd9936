"""Models at the nodes that an FMU makes itself when it starts: the bits of those in the parameter set."""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy
import networks
import numpy as np
import pytest
from fmu_runner import opened, run_fmu
from theta_networks import theta_network

import tolerances
from fmu_builder.compiler import TARGETS, host_platform
from fmu_builder.kernel import Network, blended_nodes, simulate
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import LocalLinearModel, NodeTable, ParameterSet, nested

POSITIONS = np.linspace(networks.LOW, networks.HIGH, 13)
LARGEST = 1_000_000  # bytes of an FMU with all platforms and sources
MATRICES = ("A", "B", "C", "D", "g", "x0", "u0", "y0")


def blended(one: ParameterSet, nodes: int = len(POSITIONS), **same: object) -> ParameterSet:
    """A network whose models at the nodes are sums of its local models, added one after the other."""
    positions = np.linspace(networks.LOW, networks.HIGH, nodes)
    random = np.random.default_rng(5)
    weights = random.uniform(-0.2, 1.0, (nodes, len(one.local_models)))
    weights[:, -1] = 1.0 - weights[:, :-1].sum(axis=1)
    models = []
    for row in weights:
        fields = {}
        for name in MATRICES:
            if getattr(one.local_models[0], name) is not None:
                total = np.zeros(np.shape(getattr(one.local_models[0], name)))
                for weight, model in zip(row, one.local_models, strict=True):
                    total = total + weight * np.array(getattr(model, name))
                fields[name] = nested(total)
        models.append(LocalLinearModel(**{**fields, **same}))
    table = NodeTable(positions=nested(positions), weights=nested(weights), models=tuple(models))
    return one.replaced(node_table=table)


def sources_of(path: Path) -> set[str]:
    with zipfile.ZipFile(path) as archive:
        return {name.removeprefix("sources/") for name in archive.namelist()}


def built(one: ParameterSet, folder: Path) -> Path:
    return build_llmn(one, folder / "network.fmu", (host_platform(),))


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("offsets", networks.OFFSETS)
def test_the_fmu_has_the_bits_of_the_kernel(offsets: str, feedthrough: bool, tmp_path: Path) -> None:
    one = blended(networks.network(61, offsets, "parameter", "hat", feedthrough))
    inputs = networks.inputs_of(61, 150, 3)
    path = built(one, tmp_path)
    assert {"llmn_blended.c", "node_models.c"} <= sources_of(path)
    found = run_fmu(path, inputs, one.output_names, one.sample_time)
    expected = simulate(one, inputs)
    assert np.abs(found - expected).max() == tolerances.BITS
    assert np.ptp(expected, axis=0).min() > 0.1


def test_derivatives_at_the_start_and_starts_anew(tmp_path: Path) -> None:
    one = blended(networks.network(62, "affine", "parameter", "hat", True))
    rows = networks.inputs_of(62, 4, 3)
    with opened(built(one, tmp_path), rows[0], ready=False) as (slave, references):
        for row in rows:  # every change of an input is a start anew
            kernel = Network(one)
            kernel.start(row)
            slave.setReal([0, 1, 2], row.tolist())
            expected = kernel.steady_gain(row)[: len(one.output_names)]
            unknowns = [references[name] for name in one.output_names]
            found = [slave.getDirectionalDerivative(unknowns, [column], [1.0]) for column in range(3)]
            np.testing.assert_array_equal(np.array(found).T, expected)
            assert slave.getReal(unknowns) == kernel.outputs(row).tolist()
        slave.reset()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.setReal([0, 1, 2], rows[1].tolist())
        kernel.start(rows[1])
        assert slave.getReal(unknowns) == kernel.outputs(rows[1]).tolist()


def test_an_output_matrix_that_is_the_same_everywhere_is_kept_once(tmp_path: Path) -> None:
    plain = networks.network(63, "none", "parameter", "hat", True)
    same = plain.local_models[1].C
    one = plain.replaced(
        local_models=tuple(model.model_copy(update={"C": same}) for model in plain.local_models)
    )
    one = blended(one, C=same)
    made = blended_nodes(one)
    assert made is not None and made.numbers["C"] == 0 and made.tables.sizes["output_models"] == 1
    inputs = networks.inputs_of(63, 60, 3)
    found = run_fmu(built(one, tmp_path), inputs, one.output_names, one.sample_time)
    assert np.abs(found - simulate(one, inputs)).max() == tolerances.BITS


def test_models_that_are_no_such_sums_are_constants(tmp_path: Path) -> None:
    right = blended(networks.network(64, "none", "parameter", "hat", False))
    assert right.node_table is not None
    first, *rest = right.node_table.models
    entry = float(np.nextafter(first.B[1][0], 10.0))
    wrong = ((first.B[0]), (entry, *first.B[1][1:]), *first.B[2:])
    models = (first.model_copy(update={"B": wrong}), *rest)
    one = right.replaced(node_table=right.node_table.model_copy(update={"models": models}))
    assert blended_nodes(right) is not None and blended_nodes(one) is None
    path = built(one, tmp_path)
    assert "llmn_fixed.c" in sources_of(path)
    inputs = networks.inputs_of(64, 60, 3)
    found = run_fmu(path, inputs, one.output_names, one.sample_time)
    assert np.abs(found - simulate(one, inputs)).max() == tolerances.BITS


def test_nothing_is_made_where_nothing_is_gained() -> None:
    assert blended_nodes(blended(networks.network(65, "none", "parameter", "hat", False), nodes=4)) is None
    assert blended_nodes(networks.network(65, "none", "output", "hat")) is None
    assert blended_nodes(networks.network(65, "none", "parameter", "gaussian")) is None


def test_a_surrogate_with_81_nodes_fits_a_megabyte_with_all_platforms(tmp_path: Path) -> None:
    path = build_llmn(theta_network("chain9", nodes=81), tmp_path / "theta.fmu")
    assert len(fmpy.supported_platforms(str(path))) >= 5
    with zipfile.ZipFile(path) as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert folders == set(TARGETS)
    assert path.stat().st_size < LARGEST

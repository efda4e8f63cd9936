"""Names with dots, indices and der() on request: other names, the same FMU."""

from __future__ import annotations

from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from theta_networks import theta_network
from typer.testing import CliRunner

from cosimulation.cli import app
from fmi.raw import ERROR, load
from fmi.raw import Slave as Raw
from fmu_builder.compiler import host_platform
from fmu_builder.fmi2 import model_description
from fmu_builder.llmn_fmu import build_llmn, interface
from fmus.wbm.variables import interface as wbm_interface


def names(path: Path) -> list[str]:
    return [variable.name for variable in fmpy.read_model_description(str(path)).modelVariables]


def test_a_network_has_indices_and_dots(tmp_path: Path) -> None:
    network = theta_network(nodes=5)
    flat, structured = (
        build_llmn(network, tmp_path / f"{naming}.fmu", (host_platform(),), naming=naming)
        for naming in ("flat", "structured")
    )
    assert validate_fmu(str(structured)) == []
    described = fmpy.read_model_description(str(structured), validate_variable_names=True)
    assert described.variableNamingConvention == "structured"
    assert described.guid != fmpy.read_model_description(str(flat)).guid
    found = dict(zip(names(flat), names(structured), strict=True))
    assert found["theta_m_H_2"] == "theta[2].m_H" and found["validity_4"] == "validity[4]"
    assert found["k_E"] == "k_E" and found["zeta_dot"] == "zeta_dot"
    runs = [
        fmpy.simulate_fmu(str(path), stop_time=0.05, output_interval=0.01, start_values={mass: 9.0})
        for path, mass in ((flat, "theta_m_H_2"), (structured, "theta[2].m_H"))
    ]
    assert runs[0]["F_p"].tolist() == runs[1]["F_p"].tolist()
    slave = Raw(load(structured, tmp_path), described.guid)
    assert slave.set([list(found).index("theta_m_H_2")], [1e9]) == ERROR
    assert "theta[2].m_H = 1e9 is outside" in slave.last_error()
    slave.free()


def test_the_white_box_model_has_derivatives() -> None:
    shown = wbm_interface("structured")
    text = model_description(shown, shown.guid("any"))
    assert 'name="der(phi_1_dot)"' in text and "der_phi_1_dot" not in text
    assert 'variableNamingConvention="structured"' in text


def test_a_network_is_flat_by_default() -> None:
    shown = interface(theta_network(nodes=5))
    text = model_description(shown, shown.guid("any"))
    assert 'variableNamingConvention="flat"' in text and "[" not in "".join(v.name for v in shown.variables)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["wbm", "--names", "nested"], "--names nested: is not known. Use one of: flat, structured"),
        (
            ["x.json", "--names", "structured", "--backend", "pythonfmu"],
            "--names structured: is not for",
        ),
    ],
)
def test_other_namings_are_refused(arguments: list[str], words: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(theta_network(nodes=5).canonical_json())
    given = [str(tmp_path / one) if one.endswith(".json") else one for one in arguments]
    result = CliRunner().invoke(app, ["build", *given])
    assert result.exit_code != 0
    assert words in str(result.exception)


def test_the_command_builds_them(tmp_path: Path) -> None:
    path = tmp_path / "structured.fmu"
    given = ["build", "wbm", "--names", "structured", "--platform", host_platform(), "--output", str(path)]
    assert CliRunner().invoke(app, given).exit_code == 0
    assert "der(xi)" in names(path) and validate_fmu(str(path)) == []


def test_variables_come_in_tens() -> None:
    """Importers show them all: not numbers of matrices, but what somebody may want to see or change."""
    for shown in (interface(theta_network("chain10")), wbm_interface()):
        assert len(shown.variables) < 100

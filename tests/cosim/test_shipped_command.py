"""The FMUs that come with the project have names on the command line; start values of a reference, too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import fmus
from cosim.test_command import llmn, refused, settings
from fmu_builder.compiler import host_platform

HOST = ("--platform", host_platform())
RECIPE = """
output = "data"
[reference]
fmu = '{fmu}'
start_values = {{ preset = "B", inner_step = 0.001 }}
[static_map]
heights = 9
[[experiments]]
name = "short"
kind = "whole_range"
split = "train"
duration = 0.1
"""


@pytest.mark.parametrize("name", ["wbm", "surrogate_blow"])
def test_an_fmu_is_built_by_its_name_into_the_working_folder(tmp_path: Path, name: str) -> None:
    result = llmn(tmp_path, "build", name, *HOST, "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout) == {"fmu": f"pantograph_{name}.fmu"}
    expected = fmus.build(name, tmp_path / "expected.fmu", HOST[1:])
    assert (tmp_path / f"pantograph_{name}.fmu").read_bytes() == expected.read_bytes()


def test_a_network_is_had_as_a_python_fmu_the_white_box_model_is_not(tmp_path: Path) -> None:
    result = llmn(tmp_path, "build", "--backend", "pythonfmu", "n4sid", "--json")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / json.loads(result.stdout)["fmu"]).name == "pantograph_n4sid_python.fmu"
    assert "white-box model" in refused(tmp_path, "build", "--backend", "pythonfmu", "wbm")


def test_the_names_are_told(tmp_path: Path) -> None:
    assert "no parameter set" in refused(tmp_path, "build", "")
    wrong, told = refused(tmp_path, "build", "surogate"), llmn(tmp_path, "build", "--help").stdout
    for name in fmus.NAMES:
        assert name in wrong and name in told


def test_start_values_of_the_command_line_stand_beside_those_of_the_file(tmp_path: Path) -> None:
    file = settings(tmp_path, RECIPE.format(fmu=fmus.path("wbm")))
    result = llmn(tmp_path, "generate", file, "--start", "preset=Blow", "--start", "k_E=2e5")
    assert result.returncode == 0, result.stderr
    origin = json.loads((tmp_path / "data" / "data.json").read_text(encoding="utf-8"))["origin"]
    assert origin["settings"]["reference"]["start_values"] == {
        "preset": "Blow",
        "inner_step": 0.001,
        "k_E": 2e5,
    }
    assert origin["reference"]["guid"].startswith("{")
    assert "has no '='" in refused(tmp_path, "generate", file, "--start", "preset")

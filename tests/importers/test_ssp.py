"""Parameter sets as SSV: read by pyssp-standard, put to use by ecos in an SSP of two FMUs."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import fmpy
import numpy as np
from pyssp_standard.ssv import SSV
from theta_networks import HEAD, theta_network

import tolerances
from fmus.wbm.parameters import parameter_sets
from importers.jobs import Job

STRUCTURE = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="line">
  <ssd:System name="line">
    <ssd:Elements>
      <ssd:Component name="wire" type="application/x-fmu-sharedlibrary" source="resources/wire.fmu">
        <ssd:Connectors>
          <ssd:Connector name="height" kind="output"><ssc:Real unit="m"/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="wbm" type="application/x-fmu-sharedlibrary" source="resources/pantograph_wbm.fmu">
        <ssd:Connectors>
          <ssd:Connector name="eta" kind="input"><ssc:Real unit="m"/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings><ssd:ParameterBinding source="resources/Blow.ssv"/></ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="wire" startConnector="height" endElement="wbm" endConnector="eta"/>
    </ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
"""


def extracted(fmu: Path, name: str, folder: Path) -> Path:
    with zipfile.ZipFile(fmu) as archive:
        (folder / name).write_bytes(archive.read(f"resources/{name}"))
    return folder / name


def number(text: str) -> float:
    return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)


def values(path: Path) -> dict[str, float]:
    with SSV(path) as document:
        document.__check_compliance__()
        return {one["name"]: number(one["type_value"].parameter["value"]) for one in document.parameters}


def test_every_preset_and_what_was_identified_read_back(fmus: Mapping[str, Path], tmp_path: Path) -> None:
    for name, known in parameter_sets().items():
        assert values(extracted(fmus["wbm"], f"{name}.ssv", tmp_path)) == known.values()
    found = values(extracted(fmus["surrogate"], "identified.ssv", tmp_path))
    described = fmpy.read_model_description(str(fmus["surrogate"])).modelVariables
    assert found == {
        v.name: number(v.start) for v in described if v.causality == "parameter" and v.type != "Enumeration"
    }
    assert "<ssv:Boolean" in (tmp_path / "identified.ssv").read_text(encoding="utf-8")
    assert found["k_E"] == HEAD["k_E"]
    assert found["theta_m_H_3"] == theta_network().surrogate.tuned[2]["m_H"]  # type: ignore[union-attr]
    with zipfile.ZipFile(fmus["n4sid"]) as archive:
        assert not any(name.endswith(".ssv") for name in archive.namelist())


def test_an_importer_takes_them_from_an_ssp(fmus: Mapping[str, Path], tmp_path: Path) -> None:
    package = tmp_path / "line.ssp"
    with zipfile.ZipFile(package, "w") as archive:
        archive.writestr("SystemStructure.ssd", STRUCTURE)
        archive.write(fmus["wire"], "resources/wire.fmu")
        archive.write(fmus["wbm"], "resources/pantograph_wbm.fmu")
        archive.write(extracted(fmus["wbm"], "Blow.ssv", tmp_path), "resources/Blow.ssv")
    asked = Job(
        {"wire": str(fmus["wire"]), "wbm": str(fmus["wbm"])},
        ("wbm::F_p", "wbm::zeta"),
        {"wbm::preset": list(parameter_sets()).index("Blow") + 1},
        rows=[[]] * 60,
        connections=(("wire::height", "wbm::eta"),),
    )
    found, printed = asked.by_importer("run_ecos.py", str(package), "Blow")
    assert np.abs(found - asked.by_hand()).max() == tolerances.BITS
    assert "error" not in printed.lower()

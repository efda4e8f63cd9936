"""Sweeps for tests: an FMU that misbehaves as it is told, settings, and results by other means."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from cosimulation.settings import parse_settings
from cosimulation.sweep import SweepSettings
from fmu_builder.compiler import host_platform
from fmu_builder.fmi2 import Interface, Variable, build_fmu

DEEDS = ("good", "writes_nowhere", "traps", "hangs", "fails", "poisons", "forgets_reset", "refuses_reset")
DEED = {name: float(number) for number, name in enumerate(DEEDS)}


def build_vendor(output: Path) -> Path:
    """Build the FMU of vendor.c; its reference numbers are the places here."""
    variables = (
        Variable("eta", causality="input", unit="m", start=0.0),
        Variable("M_pa", causality="input", unit="N.m", start=0.0),
        Variable("y", causality="output", unit="m"),
        Variable("in_range", type="Boolean", causality="output"),
        Variable("deed", causality="parameter", start=0.0),
        Variable("gain", causality="parameter", start=1.0),
    )
    interface = Interface(
        model_identifier="vendor",
        model_name="Vendor",
        description="Does what its parameter tells it to",
        variables=variables,
        default_step=0.001,
        stop_time=1.0,
        author="tests",
    )
    unity = Path(__file__).parent / "vendor.c"
    return build_fmu(interface, "vendor", unity, (unity.parent,), {}, output, (host_platform(),))


def settings(text: str, **keys: Any) -> SweepSettings:
    """Settings as a file has them, with some keys replaced."""
    return parse_settings(SweepSettings, {**tomllib.loads(text), **keys}, "sweep.toml")


def vendor_settings(vendor: Path, folder: Path, **keys: Any) -> SweepSettings:
    """Four runs of the FMU of vendor.c against itself, with some keys replaced."""
    text = f"""
    processes = 1
    seeds = [1, 2]
    reference = {{ fmu = "{vendor}" }}
    models = [{{ fmu = "{vendor}" }}]
    signals = [{{ name = "one", kind = "operating_point", height = 1.0, duration = 0.05 }}]
    parameters = [{{ name = "gain", values = [1, 2] }}]
    """
    return settings(text, **{"output": folder, **keys})


def table(folder: Path) -> list[dict[str, Any]]:
    """The rows of a finished sweep."""
    found: list[dict[str, Any]] = pq.read_table(folder / "results.parquet").to_pylist()
    return found


def recorded(folder: Path) -> list[str]:
    """The tasks in all parts, as often as they stand there."""
    names = sorted((folder / "parts").glob("part-*.parquet"))
    return [task for name in names for task in pq.read_table(name)["task"].to_pylist()]

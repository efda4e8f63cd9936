"""An FMU that is a source of eta: a wire that goes up and down."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fmu_builder.fmi2 import Interface, Variable, build_fmu

_C_FOLDER = Path(__file__).parent / "wire_c"


def build_wire(output: Path, platforms: Sequence[str]) -> Path:
    """Build it; `height` goes up from `lower` [m] for 25 ms with `slope` [m/s], and down again."""
    variables = (
        Variable("height", causality="output", variability="discrete", unit="m"),
        Variable("lower", causality="parameter", unit="m", start=1.4),
        Variable("slope", causality="parameter", unit="m/s", start=0.3),
    )
    shown = Interface(
        model_identifier="wire", model_name="wire", description="up and down", variables=variables
    )
    return build_fmu(shown, "wire", _C_FOLDER / "all.c", (_C_FOLDER,), {}, output, platforms)

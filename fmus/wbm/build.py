"""Building the FMU `pantograph_wbm`."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from fmu_builder.compiler import source_files
from fmu_builder.fmi2 import DEFAULT_PLATFORMS, build_fmu, parameter_values
from fmus.wbm.native import C_FOLDER, INCLUDE
from fmus.wbm.parameters import PARAMETERS_FILE, parameter_sets, parameters_header
from fmus.wbm.variables import interface

_MODEL_CARD = Path(__file__).parent / "README.md"
_EQUATIONS = C_FOLDER / "host.c"  # what it includes is what the model computes with, and nothing of FMI


def model_hash() -> str:
    """Return the hash of all the model computes with: parameter values and C sources of the equations."""
    digest = hashlib.sha256(parameters_header().encode("utf-8"))
    for name, path in sorted(source_files(_EQUATIONS, INCLUDE)):
        if path != _EQUATIONS:
            digest.update(f"\0{name}\0{path.read_text(encoding='utf-8')}".encode())
    return digest.hexdigest()


def build_wbm(output: Path, platforms: Sequence[str] = DEFAULT_PLATFORMS, naming: str = "flat") -> Path:
    """Build the white-box model as an FMU for FMI 2.0 model exchange and co-simulation.

    resources/ holds every parameter set as SSV, for importers that know no Enumeration `preset`.

    Args:
        output: The .fmu file to write.
        platforms: FMI 2.0 platform folders, keys of `fmu_builder.compiler.TARGETS`.
        naming: "flat", or "structured" names of variables.

    Returns:
        `output`.

    Raises:
        BuildError: Unknown platform, or the C code does not compile.
        OutputError: `output` cannot be written.
    """
    shown = interface(naming)
    sets = {
        f"{name}.ssv": parameter_values(name, shown, one.values()) for name, one in parameter_sets().items()
    }
    return build_fmu(
        shown,
        model_hash(),
        C_FOLDER / "all.c",
        INCLUDE,
        {"wbm_parameters.h": parameters_header()},
        output,
        platforms,
        resources={"parameters.json": PARAMETERS_FILE.read_bytes(), **sets},
        documentation={"model_card.md": _MODEL_CARD.read_bytes()},
    )

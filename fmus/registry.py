"""The one list of the FMUs that come with the project: where each is, and how it is built."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from fmu_builder import parameter_set
from fmu_builder.errors import BuildError, ParameterSetError, SettingsError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import ParameterSet
from fmus.wbm import build_wbm
from identification.stability import proved

_FMUS = Path(__file__).parent

WHITE_BOX = "wbm"
NETWORKS = {"surrogate": "A", "n4sid": "A", "surrogate_blow": "Blow", "n4sid_blow": "Blow"}
"""Networks, and the set of the white-box model that each was identified from."""
NAMES = (WHITE_BOX, *NETWORKS)
"""All FMUs; each has a folder of its name."""


def folder(name: str) -> Path:
    """Return the folder of an FMU: README.md, parameters.json, of a network scores.json and identify.toml.

    Raises:
        SettingsError: There is no FMU of that name.
    """
    if name not in NAMES:
        raise SettingsError.of(f"FMU {name!r}", "does not come with the project", f"Name {', '.join(NAMES)}")
    return _FMUS / name


def model_identifier(name: str) -> str:
    """Return the model identifier of an FMU, which is also the name of its file."""
    return f"pantograph_{folder(name).name}"


def path(name: str) -> Path:
    """Return the file of an FMU that comes with the project, ready to be loaded anywhere.

    Args:
        name: One of `NAMES`.

    Raises:
        SettingsError: There is no FMU of that name.
        BuildError: Its file is missing.
    """
    file = _place(name)
    if not file.is_file():
        raise BuildError.of(file.name, "is missing in its folder", "Build it: python -m fmus, or make fmus")
    return file


def network(name: str) -> ParameterSet:
    """Return the parameter set of a network with its scores on unseen data.

    Args:
        name: One of `NETWORKS`.

    Raises:
        SettingsError: There is no network of that name.
        ParameterSetError: Its files are damaged.
    """
    if name not in NETWORKS:
        mend = f"Name one of {', '.join(NETWORKS)}"
        raise SettingsError.of(f"network {name!r}", "does not come with the project", mend)
    found = parameter_set.load(folder(name) / "parameters.json")
    place = folder(name) / "scores.json"
    try:
        scores = json.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError) as reason:
        mend = "Take the file as it comes with the project"
        raise ParameterSetError.of(f"{name}/{place.name}", f"cannot be read ({reason})", mend) from reason
    return found.replaced(scores=scores)


def build(
    name: str, output: Path, platforms: Sequence[str] = DEFAULT_PLATFORMS, naming: str = "flat"
) -> Path:
    """Build an FMU from what stands in its folder; nothing is identified anew, certificates are proved anew.

    Args:
        name: One of `NAMES`.
        output: The .fmu file.
        platforms: FMI 2.0 platform folders.
        naming: "flat", or "structured" names of variables.

    Returns:
        `output`.

    Raises:
        SettingsError: There is no FMU of that name.
        ParameterSetError: Its files are damaged.
        CertificateError: The certificate does not prove what it claims.
        BuildError: Unknown platform, or C code that does not compile.
        OutputError: `output` cannot be written.
    """
    if name == WHITE_BOX:
        return build_wbm(output, platforms, naming)
    card = (folder(name) / "README.md").read_bytes()
    shown = network(name)
    pages = {"model_card.md": card}
    return build_llmn(shown, output, platforms, naming=naming, documentation=pages, proof=proved(shown))


def rebuild(name: str) -> Path:
    """Build an FMU in its folder; see `build`."""
    return build(name, _place(name))


def _place(name: str) -> Path:
    return folder(name) / f"{model_identifier(name)}.fmu"

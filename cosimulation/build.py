"""`llmn build`: a parameter set, or one of the FMUs that come with the project, as a file."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import fmus
from fmu_builder import parameter_set
from fmu_builder.errors import SettingsError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import ParameterSet
from fmu_builder.python_fmu import PLATFORMS, build_python_fmu
from identification.stability import proved


class Naming(StrEnum):
    """How variables are called: names every importer takes, or with dots, indices and der()."""

    FLAT = "flat"
    STRUCTURED = "structured"


class Backend(StrEnum):
    """What an FMU computes with: compiled C, or NumPy through pythonfmu."""

    NATIVE = "native"
    PYTHONFMU = "pythonfmu"


def build_model(
    model: str,
    output: Path | None,
    platforms: tuple[str, ...] = (),
    backend: Backend = Backend.NATIVE,
    naming: Naming = Naming.FLAT,
) -> Path:
    """Package a model as an FMU. A certificate of stability in a parameter set is proved anew for it.

    Args:
        model: Path of a parameter set (.json), or one of `fmus.NAMES`.
        output: FMU to write; by default beside the parameter set, or in the working folder under the model
            identifier; for pythonfmu the name ends in `_python`.
        platforms: FMI platform folders; all that can be built by default.
        backend: What it computes with; the white-box model is native only.
        naming: How variables are called; a Python FMU has flat names only.

    Returns:
        The file written.

    Raises:
        SettingsError: `model` is neither, or cannot be had with this backend.
        ParameterSetError: The parameter set is not valid; every problem is named.
        CertificateError: The certificate does not prove what it claims.
        BuildError: The compiler refused, or the backend has no such platform.
        OutputError: The file cannot be written.
    """
    chosen = platforms or DEFAULT_PLATFORMS
    if backend is Backend.PYTHONFMU:
        if naming is not Naming.FLAT:
            mend = "Build it natively, or leave --names out"
            raise SettingsError.of(f"--names {naming}", "is not for Python FMUs", mend)
        parameters = _network(model, backend)
        beside = _beside(model)
        beside = beside.with_stem(f"{beside.stem}_python")
        return build_python_fmu(parameters, output or beside, platforms or PLATFORMS)
    if model in fmus.NAMES:
        return fmus.build(model, output or _beside(model), chosen, naming)
    parameters = _network(model, backend)
    proof = proved(parameters)
    return build_llmn(parameters, output or _beside(model), chosen, naming=naming, proof=proof)


def _beside(model: str) -> Path:
    """Return where the FMU goes by default."""
    return Path(f"{fmus.model_identifier(model)}.fmu" if model in fmus.NAMES else model).with_suffix(".fmu")


def _network(model: str, backend: Backend) -> ParameterSet:
    """Return the parameter set of a file, or of a network that comes with the project."""
    if model in fmus.NETWORKS:
        return fmus.network(model)
    if model in fmus.NAMES:
        mend = "Build it natively, or give a network"
        raise SettingsError.of(f"--backend {backend}", "does not know the white-box model", mend)
    if Path(model).suffix != ".json":
        mend = f"Give the path of a parameter set (.json), or one of the words {', '.join(fmus.NAMES)}"
        raise SettingsError.of(f"model {model!r}", "is no parameter set", mend)
    return parameter_set.load(Path(model))

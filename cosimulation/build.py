"""`llmn build`: a parameter set, or one of the FMUs that come with the project, as a file."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from fmu_builder import parameter_set
from fmu_builder.errors import SettingsError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.python_fmu import PLATFORMS, build_python_fmu
from fmus.wbm import build_wbm

WHITE_BOX = "wbm"


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
    """Package a model as an FMU.

    Args:
        model: Path of a parameter set (.json), or "wbm" for the white-box pantograph.
        output: FMU to write; default NAME.fmu in the working folder, or beside the parameter set
            (NAME_python.fmu for pythonfmu).
        platforms: FMI platform folders; all that can be built by default.
        backend: What it computes with; the white-box model is native only.
        naming: How variables are called; a Python FMU has flat names only.

    Returns:
        The file written.

    Raises:
        SettingsError: `model` is neither, or cannot be had with this backend.
        ParameterSetError: The parameter set is not valid; every problem is named.
        BuildError: The compiler refused, or the backend has no such platform.
        OutputError: The file cannot be written.
    """
    chosen = platforms or DEFAULT_PLATFORMS
    native = backend is Backend.NATIVE
    if model == WHITE_BOX:
        if not native:
            mend = "Build it natively, or give a parameter set (.json)"
            raise SettingsError.of(f"--backend {backend}", "does not know the white-box model", mend)
        return build_wbm(output or Path("pantograph_wbm.fmu"), chosen, naming)
    path = Path(model)
    if path.suffix != ".json":
        mend = "Give the path of a parameter set (.json), or the word wbm"
        raise SettingsError.of(f"model {model!r}", "is no parameter set", mend)
    parameters = parameter_set.load(path)
    if native:
        return build_llmn(parameters, output or path.with_suffix(".fmu"), chosen, naming=naming)
    if naming is not Naming.FLAT:
        mend = "Build it natively, or leave --names out"
        raise SettingsError.of(f"--names {naming}", "is not for Python FMUs", mend)
    beside = path.with_name(f"{path.stem}_python.fmu")
    return build_python_fmu(parameters, output or beside, platforms or PLATFORMS)

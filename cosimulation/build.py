"""`llmn build`: a parameter set, or one of the FMUs that come with the project, as a file."""

from __future__ import annotations

from pathlib import Path

from fmu_builder import parameter_set
from fmu_builder.errors import SettingsError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm

WHITE_BOX = "wbm"


def build_model(model: str, output: Path | None, platforms: tuple[str, ...] = ()) -> Path:
    """Package a model as an FMU.

    Args:
        model: Path of a parameter set (.json), or "wbm" for the white-box pantograph.
        output: FMU to write; default NAME.fmu in the working folder, or beside the parameter set.
        platforms: FMI platform folders; all that can be built by default.

    Returns:
        The file written.

    Raises:
        SettingsError: `model` is neither.
        ParameterSetError: The parameter set is not valid; every problem is named.
        BuildError: The compiler refused.
        OutputError: The file cannot be written.
    """
    chosen = platforms or DEFAULT_PLATFORMS
    if model == WHITE_BOX:
        return build_wbm(output or Path("pantograph_wbm.fmu"), chosen)
    path = Path(model)
    if path.suffix != ".json":
        mend = "Give the path of a parameter set (.json), or the word wbm"
        raise SettingsError.of(f"model {model!r}", "is no parameter set", mend)
    parameters = parameter_set.load(path)
    return build_llmn(parameters, output or path.with_suffix(".fmu"), chosen)

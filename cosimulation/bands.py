"""Error bands of predictions: filled from a data folder, told to a person."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from cosimulation.data_folder import DataFolder
from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.parameter_set import ParameterSet, ResidualBands
from identification.residuals import ResidualSettings, residual_bands


class Banded(NamedTuple):
    """A network with its error bands.

    Attributes:
        parameter_set: The network; with bands if they can be had.
        remark: Why it has none, "" where it has.
    """

    parameter_set: ParameterSet
    remark: str


def banded(parameter_set: ParameterSet, data: DataFolder, settings: ResidualSettings | None = None) -> Banded:
    """Return a network with error bands from the folder's whole-range data of the split validation.

    Raises:
        SettingsError: An output that the network does not have.
    """
    held_out = [item.data for item in data.having("whole_range", "validation")]
    if not held_out:
        return Banded(parameter_set, "there are no whole-range data of the split validation")
    try:
        found = residual_bands(parameter_set, held_out, settings)
    except (DataError, IdentificationError) as reason:
        return Banded(parameter_set, str(reason))
    if not found:
        return Banded(parameter_set, "residuals.outputs names no output")
    if not any(value is not None for one in found for value in one.total):
        low, high = parameter_set.partition.range
        where = f"{parameter_set.partition.scheduling} from {low:g} to {high:g}"
        what = f"{', '.join(data.name for data in held_out)} of the split validation"
        return Banded(parameter_set, f"{what}: too short at every range of {where}")
    return Banded(parameter_set.replaced(residual_bands=found), "")


def band_lines(bands: ResidualBands, unit: str, scheduling: str) -> list[str]:
    """Return the bands of one output as a table for a person.

    Args:
        bands: The bands.
        unit: Of the output.
        scheduling: Name of the scheduling input.
    """
    columns = [f"{left:g} - {right:g} Hz" for left, right in pairwise(bands.frequencies)]
    head = (
        f"{bands.output} on {', '.join(bands.held_out)}: {100.0 * bands.coverage:g} % of the errors are"
        f" below [{unit}] (amplitude, phase in rad)"
    )
    lines = [head, f"{scheduling:<16}{'seconds':>9}{'all':>11}" + "".join(f"{one:>30}" for one in columns)]
    rows = zip(bands.total, bands.bound, bands.amplitude, bands.phase, strict=True)
    for (low, high), seconds, (total, *cells) in zip(
        pairwise(bands.positions), bands.seconds, rows, strict=True
    ):
        parts = [_cell(*one) for one in zip(*cells, strict=True)]
        lines.append(
            f"{f'{low:g} - {high:g}':<16}{seconds:>9.1f}{_number(total):>11}"
            + "".join(f"{one:>30}" for one in parts)
        )
    return lines


def _cell(bound: float | None, amplitude: float | None, phase: float | None) -> str:
    answer = "-" if amplitude is None or phase is None else f"{amplitude:.4f}, {phase:+.4f}"
    return f"{_number(bound)} ({answer})"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def output_units(parameter_set: ParameterSet) -> dict[str, str]:
    """Return the units of outputs and derived outputs by name."""
    units = {one.name: one.unit for one in parameter_set.outputs}
    return units | {one.name: one.unit for one in parameter_set.derived_outputs}


def bands_account(parameter_set: ParameterSet, remark: str) -> list[str]:
    """Return what `llmn identify` says of error bands: a table per output, or why there are none."""
    if not parameter_set.residual_bands:
        return [f"error bands of predictions: none, {remark}"]
    units = output_units(parameter_set)
    lines: list[str] = []
    for one in parameter_set.residual_bands:
        lines += ["", *band_lines(one, units[one.output], parameter_set.partition.scheduling)]
    return lines

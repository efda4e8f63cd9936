"""Figures that need the signals themselves: contact force, spectra, poles (thesis Figures 4.29 to 4.34)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cosimulation.data_folder import DataFolder
from cosimulation.demo import SetResult
from cosimulation.fmu_file import open_fmu
from cosimulation.linearise import linearise
from cosimulation.pantograph import OUTPUTS, TORQUE
from cosimulation.report.figures.contact_force import close_up_figure, overview_figure
from cosimulation.report.figures.poles import poles_figure
from cosimulation.report.figures.spectra import spectra_figure
from cosimulation.report.tables import mode_names, pole_rows
from cosimulation.report.views import ModelView, SetView
from cosimulation.scoring import ScoredRun
from cosimulation.study.compare.figures import COLOURS, DASHES
from cosimulation.study.compare.members import Member
from cosimulation.study.compare.settings import POINTS
from cosimulation.study.data import centres

Run = tuple[Member, Mapping[str, ScoredRun]]
CONTACT_FORCE, CLOSE_UP, SPECTRA, POLES = "contact force", "close-up", "spectra", "poles"


def drawings(fmu: Path, data: DataFolder, runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return one record per figure: `drawing`, `wbm`, `svg`, `caption`, of poles also `rows` and `modes`.

    Args:
        fmu: The white-box FMU.
        data: Of the first draw.
        runs: Models and their runs by split; that of "test" is drawn.
    """
    view = _view(fmu, data, runs)
    test = runs[0][1]["test"].experiment
    speed = test.data.header["slew_rate"]
    where = f"Set {view.name}, test signal at {speed:g} m/s"
    captions = (
        (CONTACT_FORCE, overview_figure(view),
         f"{where}: the contact force, the largest error of every model, validity functions and height."),
        (CLOSE_UP, close_up_figure(view),
         f"{where}, around the largest error of {view.best.title} (the thesis shows "
         "such places in Figures 4.9, 4.13, 4.25 and 4.34)."),
        (SPECTRA, spectra_figure(view),
         f"{where}: amplitude spectra; shaded: the white-box model's modes over the four operating points. "
         "The thesis shows those at single operating points (Figures 4.29 to 4.31)."),
        (POLES, poles_figure(view),
         f"Set {view.name}: poles of the local models in the z plane beside those of the white-box model "
         "linearised at OP25, OP45, OP65 and OP85 (Figure 4.33)."),
    )  # fmt: skip
    found: list[dict[str, Any]] = [
        {"drawing": kind, "wbm": view.name, "svg": svg, "caption": caption} for kind, svg, caption in captions
    ]
    found[-1] |= {"rows": pole_rows(view), "modes": mode_names(view)}
    return found


def _view(fmu: Path, data: DataFolder, runs: Sequence[Run]) -> SetView:
    """Return the models as the report's figures take them."""
    wbm = runs[0][0].candidate.labels["wbm"]
    points = [{"eta": height, "M_pa": TORQUE} for height in centres(POINTS)]
    with open_fmu(fmu) as opened:
        linear = tuple(linearise(opened, point, OUTPUTS, {"preset": wbm}) for point in points)
    models = []
    for member, by_split in runs:
        records = {(run, one["signal"]): one for run, item in by_split.items() for one in item.records}
        named = replace(member.candidate, title=f"{member.label}: {member.candidate.title}")
        look = COLOURS[member.family], DASHES[member.family]
        models.append(ModelView(named, by_split, records, None, *look))
    return SetView(SetResult(wbm, data, linearisations=linear), tuple(models))

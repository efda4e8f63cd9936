"""The main job, once and whole: white-box model -> data -> networks -> FMUs -> co-simulation -> report."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosimulation.candidates import Candidate, identify_candidates
from cosimulation.data_folder import DataFolder, Experiment
from cosimulation.fmu_file import open_fmu
from cosimulation.generate import make_data
from cosimulation.linearise import Linearisation, linearise
from cosimulation.pantograph import OUTPUTS, TORQUE
from cosimulation.progress import SILENT, Reporter
from cosimulation.result_folder import result_folder
from cosimulation.scoring import ScoredRun, marked_recommended, run_candidate, step_times
from cosimulation.settings import (
    ExperimentSettings,
    GenerateSettings,
    Reference,
    load_shipped_settings,
)
from fmu_builder.files import write_text
from fmu_builder.fmi2 import DEFAULT_PLATFORMS
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm
from identification.warning import IdentificationWarning

WHITE_BOX_SETS = ("A", "Blow")
SEED = 1
"""Seed of every random draw of the demo."""

RESULT = "llmn demo 1"
"""Kind of its result folder."""


@dataclass
class SetResult:
    """Everything the demo found out on one white-box set.

    Attributes:
        wbm: Name of the white-box set.
        data: Its reference data.
        candidates: The identified models.
        runs: Co-simulations of their FMUs by candidate name, one per experiment.
        linearisations: The white-box model linearised at the centre of every local model.
    """

    wbm: str
    data: DataFolder
    candidates: tuple[Candidate, ...] = ()
    runs: dict[str, tuple[ScoredRun, ...]] = field(default_factory=dict)
    linearisations: tuple[Linearisation, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """What makes the models doubtful; what several share, such as local models, once."""
        holders: dict[IdentificationWarning, list[str]] = {}
        for candidate in self.candidates:
            for warning in candidate.warnings:
                holders.setdefault(warning, []).append(candidate.title)
        return [
            f"{titles[0]}: {warning}" if len(titles) == 1 else str(warning)
            for warning, titles in holders.items()
        ]


@dataclass
class DemoResult:
    """The whole run, as the report shows it.

    Attributes:
        folder: Where the results are.
        sets: One per white-box set.
        scores: Records of scores.json.
        timings: Content of timings.json.
        quick: Whether it ran on short data.
    """

    folder: Path
    sets: tuple[SetResult, ...]
    scores: list[dict[str, Any]]
    timings: dict[str, Any]
    quick: bool

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        return {
            "folder": str(self.folder),
            "scores": self.scores,
            "warnings": self.warnings(),
            "timings": self.timings,
        }

    def text(self) -> str:
        """Return the contact force's FIT on test data for a person."""
        lines = [f"{'FIT of F_p on unseen data [%]':<44}" + "".join(f"{one.wbm:>9}" for one in self.sets)]
        for label, fits in self.contact_force_fits().items():
            cells = "".join(f"{fits[one.wbm]:>9.2f}" if one.wbm in fits else f"{'-':>9}" for one in self.sets)
            lines.append(f"{label:<44}{cells}")
        lines += [f"warning: {wbm}, {warning}" for wbm, found in self.warnings().items() for warning in found]
        lines.append(f"report: {self.folder / 'report.html'}")
        return "\n".join(lines)

    def warnings(self) -> dict[str, list[str]]:
        """Return what makes models doubtful by white-box set."""
        return {one.wbm: one.warnings for one in self.sets}

    def contact_force_fits(self) -> dict[str, dict[str, float]]:
        """Return label -> white-box set -> FIT of F_p on test data."""
        found: dict[str, dict[str, float]] = {}
        for one in self.sets:
            for candidate in one.candidates:
                for run in one.runs[candidate.name]:
                    if run.experiment.split == "test":
                        fits = {item["signal"]: item["fit"] for item in run.records}
                        found.setdefault(candidate.title, {})[one.wbm] = fits["F_p"]
        return found


def generate_settings(fmu: Path, preset: str, quick: bool) -> GenerateSettings:
    """Return the demo's data settings: `studies/demo.toml` on one white-box set.

    Args:
        fmu: The white-box FMU.
        preset: The white-box set.
        quick: Short experiments.
    """
    settings = load_shipped_settings(GenerateSettings, "demo.toml")
    experiments = settings.experiments
    if quick:
        shorter = {"operating_point": 12.0, "whole_range": 20.0}
        experiments = tuple(
            ExperimentSettings(**{**item.model_dump(), "duration": shorter[item.kind]})
            for item in experiments
        )
    reference = Reference(fmu=fmu, start_values={"preset": preset})
    return settings.model_copy(update={"reference": reference, "experiments": experiments})


def run_demo(
    output: Path,
    quick: bool = False,
    reporter: Reporter = SILENT,
    platforms: Sequence[str] = DEFAULT_PLATFORMS,
) -> DemoResult:
    """Run the pantograph from the white-box model to the report.

    Args:
        output: Folder of the results; replaced as a whole when everything is done.
        quick: Short data: every step, worse figures.
        reporter: Told how far it is.
        platforms: FMI platform folders of the FMUs.

    Raises:
        LlmnError: Something could not be done; nothing is left behind then.
    """
    from cosimulation.report import PICTURE, write_picture, write_report

    clock = _Clock()
    with result_folder(output, RESULT) as folder:
        with clock.phase("build white-box FMU"):
            white_box = build_wbm(folder / "fmus" / "pantograph_wbm.fmu", platforms)
        sets = tuple(
            _run_set(folder, white_box, wbm, quick, clock, reporter, platforms) for wbm in WHITE_BOX_SETS
        )
        scores = marked_recommended(
            [item for one in sets for runs in one.runs.values() for run in runs for item in run.records]
        )
        with clock.phase("measure step times"):
            steps = step_times(folder / "fmus", white_box)
        result = DemoResult(output, sets, scores, {"seconds": clock.seconds, "steps": steps}, quick)
        reporter.say("report")
        with clock.phase("report"):
            write_report(folder / "report.html", result)
            write_picture(folder / PICTURE, result)
        write_text(folder / "scores.json", json.dumps(scores, indent=1) + "\n")
        write_text(folder / "timings.json", json.dumps(result.timings, indent=1) + "\n")
        write_text(folder / "settings.json", json.dumps(_settings_used(sets), indent=1) + "\n")
    return result


def _run_set(
    folder: Path,
    white_box: Path,
    wbm: str,
    quick: bool,
    clock: _Clock,
    reporter: Reporter,
    platforms: Sequence[str],
) -> SetResult:
    """Data, models, FMUs and co-simulations of one white-box set."""
    settings = generate_settings(white_box, wbm, quick)
    reporter.say(f"white-box set {wbm}")
    with clock.phase(f"reference data {wbm}"):
        data = make_data(settings, reporter)
        target = folder / "data" / wbm
        target.mkdir(parents=True)
        data.save(target)
    reporter.say("identification")
    with clock.phase(f"identification {wbm}"), open_fmu(white_box) as fmu:
        candidates = identify_candidates(wbm, data, fmu, settings)
        centres = max((item.parameter_set.partition.centres for item in candidates), key=len)
        points = [{"eta": centre, "M_pa": TORQUE} for centre in centres]
        start_values = settings.reference.start_values
        linearisations = tuple(linearise(fmu, point, OUTPUTS, start_values) for point in points)
    result = SetResult(wbm, data, candidates, linearisations=linearisations)
    fmus = {}
    with clock.phase(f"build FMUs {wbm}"):
        for candidate in candidates:
            candidate.parameter_set.save(folder / "models" / f"{candidate.name}.json")
            path = folder / "fmus" / f"{candidate.name}.fmu"
            fmus[candidate.name] = build_llmn(candidate.parameter_set, path, platforms)
    unseen = _unseen(data)
    total = sum(len(item.data) for item in unseen) * len(candidates)
    with clock.phase(f"co-simulation {wbm}"), reporter.bar(f"co-simulation {wbm}", total) as advance:
        for candidate in candidates:
            result.runs[candidate.name] = tuple(
                run_candidate(candidate, fmus[candidate.name], item, settings.seed, advance)
                for item in unseen
            )
    return result


def _settings_used(sets: Sequence[SetResult]) -> dict[str, Any]:
    """Settings of data and models by white-box set; every model's own stand in its parameter set, too."""
    return {
        one.wbm: {
            "data": one.data.origin["settings"],
            "models": {item.name: item.parameter_set.provenance for item in one.candidates},
        }
        for one in sets
    }


def _unseen(data: DataFolder) -> tuple[Experiment, ...]:
    """Whole-range experiments that no model was trained on."""
    return (*data.select("whole_range", "validation"), *data.select("whole_range", "test"))


class _Clock:
    """Wall time by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def phase(self, name: str) -> _Phase:
        return _Phase(name, self.seconds)


class _Phase:
    def __init__(self, name: str, seconds: dict[str, float]) -> None:
        self.name, self.seconds, self.begin = name, seconds, 0.0

    def __enter__(self) -> None:
        self.begin = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self.seconds[self.name] = round(time.perf_counter() - self.begin, 3)

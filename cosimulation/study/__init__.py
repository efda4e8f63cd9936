"""Studies: `llmn study NAME` runs `cosimulation/studies/NAME.toml` and writes runs/study-NAME/."""

from __future__ import annotations

from pathlib import Path

from cosimulation.progress import SILENT, Reporter
from cosimulation.study.runner import StudyResult

STUDIES = (
    "order",
    "blending",
    "surrogate",
    "shipped",
    "white_box",
    "lolimot",
    "compare",
    "contact",
    "extrapolation",
)


def run_study(
    name: str,
    output: Path | None = None,
    settings_file: Path | None = None,
    seeds: tuple[int, ...] = (),
    reporter: Reporter = SILENT,
) -> StudyResult:
    """Run a study.

    Args:
        name: One of `STUDIES`.
        output: Folder of the results; runs/study-NAME by default.
        settings_file: Stands in for the settings that come with the project.
        seeds: Stand in for those of the settings.
        reporter: Told how far it is.

    Raises:
        SettingsError: There is no such study, or the settings are wrong.
        LlmnError: A step failed; nothing is left behind then.
    """
    from cosimulation.study.job import run

    return run(name, output or Path("runs") / f"study-{name}", settings_file, seeds, reporter)

"""Study: networks beyond what they were trained on, one cause at a time."""

from cosimulation.study.extrapolation.sections import lines, sections
from cosimulation.study.extrapolation.settings import ExtrapolationSettings
from cosimulation.study.extrapolation.task import run_task, tasks

__all__ = ["ExtrapolationSettings", "lines", "run_task", "sections", "tasks"]

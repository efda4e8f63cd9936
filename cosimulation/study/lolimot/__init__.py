"""Study: LOLIMOT, the thesis's first attempt, and where its blend of state-space systems soars."""

from cosimulation.study.lolimot.sections import lines, sections
from cosimulation.study.lolimot.settings import LolimotStudySettings
from cosimulation.study.lolimot.task import run_task, tasks

__all__ = ["LolimotStudySettings", "lines", "run_task", "sections", "tasks"]

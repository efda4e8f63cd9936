"""Study: structures x routes to theta x seeds of the mechanical surrogate."""

from cosimulation.study.surrogate.sections import sections
from cosimulation.study.surrogate.settings import SurrogateStudySettings
from cosimulation.study.surrogate.task import run_task, tasks

__all__ = ["SurrogateStudySettings", "run_task", "sections", "tasks"]

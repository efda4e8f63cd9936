"""Study: all models of the thesis's Figure 4.35 on twelve whole-range signals, and its Tables 4.4 to 4.6."""

from cosimulation.study.compare.pages import overview, pages
from cosimulation.study.compare.settings import CompareSettings
from cosimulation.study.compare.task import run_task, tasks

__all__ = ["CompareSettings", "overview", "pages", "run_task", "tasks"]

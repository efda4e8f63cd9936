"""Study: what the thesis says of the white-box model (section 2.1), measured on its FMU."""

from cosimulation.study.white_box.sections import sections
from cosimulation.study.white_box.settings import WhiteBoxSettings
from cosimulation.study.white_box.task import run_task, tasks

__all__ = ["WhiteBoxSettings", "run_task", "sections", "tasks"]

"""Study: networks identified without friction and loss of contact beside a pantograph that has both."""

from cosimulation.study.contact.sections import lines, sections
from cosimulation.study.contact.settings import ContactSettings
from cosimulation.study.contact.task import run_task, tasks

__all__ = ["ContactSettings", "lines", "run_task", "sections", "tasks"]

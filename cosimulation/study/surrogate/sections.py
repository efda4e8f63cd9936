"""What the page of the surrogate study shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosimulation.pantograph import SIGNALS
from cosimulation.report.tables import Cell, TextRow
from cosimulation.study.page import Row, Section, Table, TextTable
from cosimulation.study.surrogate.parameter_sections import parameter_sections
from cosimulation.study.surrogate.optima_section import optima_section
from cosimulation.study.surrogate.settings import (
    ACCEPTANCE_NOISE,
    ComparisonTable,
    SurrogateConfiguration,
    SurrogateStudySettings,
)
from cosimulation.study.tables import Shown, by_configuration, statistics, with_noise

Records = Sequence[Mapping[str, Any]]

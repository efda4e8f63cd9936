"""What the page needs of scores and findings: medians over the seeds by cause and value."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from cosimulation.study.extrapolation.settings import Cause, ExtrapolationSettings
from cosimulation.study.extrapolation.task import CLAMP, WARN, situation
from cosimulation.study.side_by_side import WHITE_BOX, NetworkFits, Record, median


class Results(NetworkFits):
    """Scores and findings of a study, looked up by their labels.

    Args:
        settings: The study's.
        scores: Score records.
        findings: Measures.
    """

    def __init__(
        self, settings: ExtrapolationSettings, scores: Sequence[Record], findings: Sequence[Record]
    ) -> None:
        super().__init__(settings.sets, scores)
        self.settings = settings
        self._measures: dict[tuple[Any, ...], list[float]] = defaultdict(list)
        clamped = False
        for item in findings:
            keys = ("measure", "wbm", "network", "cause", "at", "policy")
            value = np.nan if item["value"] is None else item["value"]
            self._measures[tuple(item[key] for key in keys)].append(value)
            clamped = clamped or item["policy"] == CLAMP
        self.policies = (WARN, CLAMP) if clamped else (WARN,)

    def fit(self, wbm: str, network: str, cause: Cause, at: float, policy: str = WARN) -> float:
        """Return the median FIT of F_p [%], NaN where there is none."""
        return median(self.fits(wbm, network, situation(cause.name, at, policy)))

    def worst_fit(self, wbm: str, cause: Cause, at: float, policy: str = WARN) -> float:
        """Return the smallest FIT of F_p over networks and seeds [%], NaN where there is none."""
        return self.smallest_fit(wbm, situation(cause.name, at, policy))

    def value(
        self, measure: str, wbm: str, network: str, cause: Cause, at: float, policy: str = WARN
    ) -> float:
        """Return the median of a measure, NaN where there is none."""
        return median(self._measures[measure, wbm, network, cause.name, at, policy])

    def reference(self, measure: str, wbm: str, cause: Cause, at: float) -> float:
        """Return the median of a measure of the white-box model or of the inputs."""
        return self.value(measure, wbm, WHITE_BOX, cause, at)

"""What the page needs of scores and findings: medians over the seeds by situation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from cosimulation.pantograph import TORQUE
from cosimulation.study.contact.settings import ContactSettings
from cosimulation.study.contact.situation import Situation
from cosimulation.study.side_by_side import NetworkFits, Record, median

Points = dict[float, float]


class Results(NetworkFits):
    """Scores and findings of a study, looked up by their labels.

    Args:
        settings: The study's.
        scores: Score records.
        findings: Measures and curves.
    """

    def __init__(
        self, settings: ContactSettings, scores: Sequence[Record], findings: Sequence[Record]
    ) -> None:
        super().__init__(settings.sets, scores)
        self.settings = settings
        self._drawings = [item for item in findings if "drawing" in item]
        self._measures: dict[tuple[Any, ...], list[Record]] = defaultdict(list)
        for item in findings:
            if "measure" in item:
                place = item["measure"], item["wbm"], item["network"], item["situation"]
                self._measures[place].append(item)

    def drawings(self, kind: str, wbm: str) -> list[Record]:
        """Return curves of one kind."""
        return [item for item in self._drawings if (item["drawing"], item["wbm"]) == (kind, wbm)]

    def fit(self, wbm: str, network: str, situation: Situation, contact: str, signal: str = "F_p") -> float:
        """Return the median FIT of a signal [%], NaN where there is none."""
        return median(self.fits(wbm, network, situation.name(contact), signal))

    def value(
        self, measure: str, wbm: str, network: str, situation: Situation, contact: str, field: str = "value"
    ) -> float:
        """Return the median of a measure, or of what the white-box model has in its place ("reference")."""
        found = self._measures[measure, wbm, network, situation.name(contact)]
        return median([np.nan if item[field] is None else item[field] for item in found])

    def worst_fit(self, wbm: str, situation: Situation, contact: str, signal: str = "F_p") -> float:
        """Return the smallest FIT of a signal over networks and seeds [%], NaN where there is none."""
        return self.smallest_fit(wbm, situation.name(contact), signal)

    def largest(self, measure: str, wbm: str, situation: Situation, contact: str) -> float:
        """Return the largest value of a measure over networks and seeds, NaN where there is none."""
        values = [
            np.inf if item["value"] is None else float(item["value"])
            for name in self.networks(wbm)
            for item in self._measures[measure, wbm, name, situation.name(contact)]
        ]
        return max(values, default=float("nan"))

    def frictions(self, amplitude: float) -> list[Situation]:
        """Return the situations with friction, in the order of the settings."""
        return [Situation("friction", case.name, case.coulomb, amplitude) for case in self.settings.frictions]

    def lift_offs(self, torque: float = TORQUE) -> list[Situation]:
        """Return the situations with lift-off at one mean torque, in the order of the settings."""
        none = self.settings.frictions[0].name
        return [
            Situation("lift-off", none, 0.0, amplitude, torque, unilateral=True)
            for amplitude in self.settings.amplitudes
        ]

    def combinations(self) -> list[Situation]:
        """Return the situations with both."""
        return [
            Situation(
                "both",
                one.friction,
                self.settings.friction(one.friction).coulomb,
                one.amplitude,
                one.torque,
                unilateral=True,
            )
            for one in self.settings.combinations
        ]

    def jumps(self) -> list[Situation]:
        """Return the raised and the dropped wire."""
        none = self.settings.frictions[0].name
        rises = self.settings.jump, -self.settings.jump
        return [Situation("jump", none, amplitude=rise, unilateral=True) for rise in rises]

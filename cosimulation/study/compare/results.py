"""The study's records, found by what the pages ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosimulation.scoring import DECIDING_SIGNAL
from cosimulation.study.compare.figures import Box
from cosimulation.study.compare.members import NUMBERS
from cosimulation.study.compare.settings import CompareSettings

Records = Sequence[Mapping[str, Any]]
_FAMILY_OF = {number: family for family, number in NUMBERS.items()}


@dataclass(frozen=True)
class SetResults:
    """Everything on one white-box set.

    Attributes:
        wbm: The white-box set.
        settings: Of the study.
        scores: Score records of the set.
        findings: Other records of the set.
    """

    wbm: str
    settings: CompareSettings
    scores: Records
    findings: Records

    @property
    def labels(self) -> tuple[str, ...]:
        """Models that ran on the test signals, in their order."""
        return tuple(dict.fromkeys(one["route"] for one in self.scores if one["split"] == "test"))

    def fit(self, label: str, data_set: str, signal: str = DECIDING_SIGNAL) -> float:
        """Return a FIT [%], minus infinity where the run is not finite.

        Raises:
            KeyError: There is no such record.
        """
        for one in self.scores:
            if (one["route"], one["data_set"], one["signal"]) == (label, data_set, signal):
                return -np.inf if one["fit"] is None else float(one["fit"])
        raise KeyError(f"{label} has no {signal} on {data_set}")

    def fits(self, label: str) -> list[float]:
        """Return the FIT of F_p [%] of a model on every test signal, in the order of the slew rates."""
        return [self.fit(label, one.name) for one in self.settings.signals()]

    def box(self, label: str) -> Box:
        """Return the FIT of F_p of a model on the test signals."""
        return Box(label, family_of(label), self.fits(label))

    def boxes(self) -> list[Box]:
        """Return every model's."""
        return [self.box(label) for label in self.labels]

    def measured(self, what: str, label: str, data_set: str) -> float:
        """Return a measure, not a number where it could not be taken.

        Raises:
            KeyError: There is no such record.
        """
        for one in self.findings:
            if (one.get("measure"), one.get("model"), one.get("data_set")) == (what, label, data_set):
                return float("nan") if one["value"] is None else float(one["value"])
        raise KeyError(f"{label} has no {what} on {data_set}")

    def drawing(self, kind: str) -> Mapping[str, Any]:
        """Return the record of a figure.

        Raises:
            StopIteration: There is none.
        """
        return next(one for one in self.findings if one.get("drawing") == kind)


def family_of(label: str) -> str:
    """Return the family of a model by its number."""
    return _FAMILY_OF[label[:2]]


def results_of(wbm: str, settings: CompareSettings, scores: Records, findings: Records) -> SetResults:
    """Return what belongs to one white-box set."""
    return SetResults(
        wbm,
        settings,
        [one for one in scores if one["wbm"] == wbm],
        [one for one in findings if one.get("wbm") == wbm],
    )

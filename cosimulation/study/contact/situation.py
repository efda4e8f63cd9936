"""One situation: what the pantograph goes through, and how far a network is from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from cosimulation.pantograph import SIGNALS, TORQUE
from cosimulation.study.side_by_side import SAMPLE_TIME, Record, measured, network_labels
from identification.arrays import Array
from identification.contact_statistics import (
    ContactStatistics,
    agreement_of_losses,
    contact_losses,
    contact_statistics,
    first_loss,
)
from identification.excitation import ACCEPTANCE, whole_range_inputs
from identification.scores import records, scored_rows

Part = Literal["friction", "lift-off", "both", "jump", "ramp"]
F_P = SIGNALS.index("F_p")
_STREAM = 700
QUANTILE = 0.95

STATISTICS = {
    "mean": ("mean F_p", "N"),
    "standard_deviation": ("standard deviation of F_p", "N"),
    "maximum": ("largest F_p", "N"),
    "minimum": ("smallest F_p", "N"),
    "banded_standard_deviation": ("standard deviation of F_p up to 20 Hz", "N"),
    "statistical_maximum": ("statistical maximum of F_p", "N"),
    "statistical_minimum": ("statistical minimum of F_p", "N"),
    "loss": ("time without contact", "%"),
    "losses": ("lost contacts", "1"),
    "long_losses": ("lost contacts of 5 ms and more", "1"),
    "mean_loss": ("mean length of a lost contact", "s"),
    "longest_loss": ("longest lost contact", "s"),
}
"""Field of the statistics -> name of the measure, unit."""


@dataclass(frozen=True)
class Situation:
    """What a run is about.

    Attributes:
        part: Of the study.
        friction: Name of the friction case.
        coulomb: T_c of its base joint [N.m].
        amplitude: Of wire noise and torque steps, 1 is the acceptance recipe's.
        torque: Mean torque [N.m].
        unilateral: Whether the white-box model's pan-head may leave the wire.
    """

    part: Part
    friction: str
    coulomb: float = 0.0
    amplitude: float = 0.0
    torque: float = TORQUE
    unilateral: bool = False

    def labels(self, wbm: str, network: str, seed: int, contact: str) -> Record:
        """Return the fields that every finding of this study has.

        Args:
            wbm: White-box set.
            network: Name of a network, or of what takes its place.
            seed: Of the draw.
            contact: How the network treats the contact, "unilateral" or "bilateral".
        """
        return {
            "wbm": wbm,
            "network": network,
            "seed": seed,
            "contact": contact,
            **{item.name: getattr(self, item.name) for item in fields(self)},
            "situation": self.name(contact),
        }

    def name(self, contact: str) -> str:
        """Return the name of the record that scores are under; tells what the network does about contact."""
        return (
            f"{self.part}, {self.friction}, amplitude {self.amplitude:g}, {self.torque:g} N.m, network "
            f"{contact}"
        )


def excitation(situation: Situation, seed: int, duration: float) -> Array:
    """Return the inputs of a whole-range record, [N, 2]: the acceptance recipe, scaled and shifted.

    The draw depends on the seed only: every situation sees the same noise and the same steps.
    """
    settings = ACCEPTANCE.model_copy(
        update={
            "noise_rms": ACCEPTANCE.noise_rms * situation.amplitude,
            "torque_amplitude": ACCEPTANCE.torque_amplitude * situation.amplitude,
            "torque": situation.torque,
        }
    )
    return whole_range_inputs(seed, (_STREAM,), duration, settings=settings).values


def compared(reference: Array, outputs: Array, labels: Record) -> Iterator[Record]:
    """Yield scores and findings of one run beside the reference, both [N, 6]; the last 75 % count."""
    known = labels["network"], labels["situation"], labels["seed"]
    yield from _scores(reference, outputs, labels["wbm"], *known)
    theirs, ours = reference[:, F_P], outputs[:, F_P]
    rows = scored_rows(len(ours))
    yield from force_findings(theirs[rows], ours[rows], labels)
    yield from timing(theirs, ours, labels)


def _scores(
    reference: Array, outputs: Array, wbm: str, network: str, situation: str, seed: int
) -> list[dict[str, Any]]:
    return records(reference, outputs, SIGNALS, network_labels(wbm, network, situation, seed))


def force_findings(reference: Array, force: Array, labels: Record) -> Iterator[Record]:
    """Yield the findings on a contact force beside the reference's, both [N]; all rows count."""
    theirs, ours = (contact_statistics(one, SAMPLE_TIME) for one in (reference, force))
    for field, (name, unit) in STATISTICS.items():
        yield _beside(name, getattr(ours, field), getattr(theirs, field), unit, labels)
    error = np.abs(force - reference)
    yield _alone("95 % quantile of the error of F_p", float(np.quantile(error, QUANTILE)), "N", labels)
    yield _alone("largest error of F_p", float(error.max()), "N", labels)
    yield _alone("error of mean F_p", abs(ours.mean - theirs.mean), "N", labels)
    yield _alone("error of the standard deviation of F_p", _percent(ours, theirs), "%", labels)
    yield _alone("error of the time without contact", abs(ours.loss - theirs.loss), "%", labels)
    yield _alone("common share of lost contact", agreement_of_losses(reference, force), "%", labels)
    if labels["contact"] == "unilateral":
        yield below_zero(force, labels)


def below_zero(force: Array, labels: Record) -> Record:
    """Return how far a contact force pulls at most, as a finding."""
    return _alone("F_p below zero", max(0.0, -float(force.min())), "N", labels)


def _percent(ours: ContactStatistics, theirs: ContactStatistics) -> float:
    return 100.0 * abs(ours.standard_deviation / theirs.standard_deviation - 1.0)


def timing(reference: Array, force: Array, labels: Record) -> Iterator[Record]:
    """Yield when contact is lost for the first time and regained, from the start of the record."""
    theirs, ours = (first_loss(contact_losses(one, SAMPLE_TIME)) for one in (reference, force))
    for name, chosen in (("first lift-off", "begin"), ("first re-contact", "end")):
        times = [float("nan") if one is None else getattr(one, chosen) for one in (ours, theirs)]
        if not all(map(np.isnan, times)):
            yield _beside(name, times[0], times[1], "s", labels)


def _beside(name: str, ours: float, theirs: float, unit: str, labels: Record) -> Record:
    reference = float(theirs) if np.isfinite(theirs) else None
    return {**measured(name, ours, unit, labels), "reference": reference}


def _alone(name: str, value: float, unit: str, labels: Record) -> Record:
    return {**measured(name, value, unit, labels), "reference": None}

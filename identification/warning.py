"""What makes an identified model doubtful, although it could be identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.data_set import DataSet

POOR_FIT = 50.0
"""FIT on training data [%] below which a model misses more than half of a signal's standard deviation."""

STRAY_SHARE = 0.01
"""Share of whole-range training rows that may lie outside the operating range."""


@dataclass(frozen=True)
class IdentificationWarning:
    """One thing that makes a model doubtful.

    Attributes:
        place: Where, in the user's words.
        what: What is doubtful there, with the figure that says so and its limit.
        mend: What to do about it.
    """

    place: str
    what: str
    mend: str

    def __str__(self) -> str:
        return f"{self.place}: {self.what}. {self.mend}."

    def record(self) -> dict[str, str]:
        """Return it as JSON can hold it."""
        return {"place": self.place, "what": self.what, "mend": self.mend}


def poor_fits(place: str, fits: Mapping[str, float | None], mend: str) -> list[IdentificationWarning]:
    """Return a warning for every signal whose FIT on training data is poor.

    Args:
        place: Of what model they are.
        fits: FIT by signal [%]; None for a signal at rest.
        mend: What to do about it.
    """
    return [
        IdentificationWarning(
            f"{place}output {name!r}", f"FIT on its training data is {fit:.1f} %, below {POOR_FIT:g} %", mend
        )
        for name, fit in fits.items()
        if fit is not None and not fit >= POOR_FIT
    ]


def stray_data(
    training: Sequence[DataSet], scheduling: str, limits: tuple[float, float]
) -> list[IdentificationWarning]:
    """Return a warning for every whole-range data set that leaves the operating range for too long.

    Args:
        training: Whole-range training data.
        scheduling: The input that schedules.
        limits: Low and high end of the operating range.
    """
    low, high = limits
    found = []
    for data in training:
        place = data.column(scheduling)
        share = float(np.mean((place < low) | (place > high)))
        if share > STRAY_SHARE:
            what = (
                f"{100.0 * share:.3g} % of its rows have {scheduling} outside {low:g} .. {high:g}, where"
                f" weights are held; the limit is {100.0 * STRAY_SHARE:g} %"
            )
            mend = "Widen n4sid.low and n4sid.high with local models there, or leave these rows out"
            found.append(IdentificationWarning(f"data set {data.name!r}", what, mend))
    return found

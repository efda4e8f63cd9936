"""What the thesis published, to stand beside our figures; every entry names its table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LINEAR_REMARK = (
    "Table 4.6 of the thesis lists the linearised model too; its figure is not legible in the copy at hand. "
    "Its largest relative error of F_p is about 35 % (section 4.8)."
)


@dataclass(frozen=True)
class PublishedFit:
    """One column of Table 4.5.

    Attributes:
        title: Which model of the thesis.
        source: Table and data.
        fits: FIT [%] by signal.
    """

    title: str
    source: str
    fits: Mapping[str, float]


_SOURCE = "Table 4.5, whole range, validation"
SURROGATE = PublishedFit(
    "thesis: surrogate, 4 LLM, parameter blending",
    _SOURCE,
    {"xi": 98.28, "xi_dot": -14.81, "zeta": 99.16, "zeta_dot": 61.74, "F_H": -28.83, "F_p": 63.33},
)
N4SID_OUTPUT = PublishedFit(
    "thesis: n4sid, 4 LLM, output blending",
    _SOURCE,
    {"xi": 99.12, "xi_dot": 61.08, "zeta": 99.07, "zeta_dot": 76.63, "F_H": 68.54, "F_p": 81.33},
)
N4SID_PARAMETER = PublishedFit(
    "thesis: n4sid, 4 LLM, parameter blending",
    _SOURCE,
    {"xi": 99.15, "xi_dot": 64.57, "zeta": 99.02, "zeta_dot": 77.91, "F_H": 49.46, "F_p": 81.78},
)
SURROGATE_TRAINING = PublishedFit(
    "thesis: surrogate, 4 LLM, parameter blending",
    "Table 4.5, whole range, training",
    {"xi": 98.67, "xi_dot": 30.37, "zeta": 99.54, "zeta_dot": 83.67, "F_H": 29.26, "F_p": 77.56},
)
ONE_SURROGATE_TRAINING = PublishedFit(
    "thesis: surrogate, 1 LLM",
    "Table 4.5, operating point, training",
    {"xi": 59.62, "xi_dot": -43.56, "zeta": 89.56, "zeta_dot": 50.43, "F_H": -60.44, "F_p": 54.69},
)
ONE_SURROGATE = PublishedFit(
    "thesis: surrogate, 1 LLM",
    "Table 4.5, operating point, validation",
    {"xi": 67.57, "xi_dot": -30.40, "zeta": 91.14, "zeta_dot": 60.48, "F_H": -47.93, "F_p": 64.86},
)
ONE_N4SID_TRAINING = PublishedFit(
    "thesis: n4sid, 1 LLM",
    "Table 4.5, operating point, training",
    {"xi": 92.48, "xi_dot": 90.64, "zeta": 92.19, "zeta_dot": 91.27, "F_H": 91.01, "F_p": 91.41},
)
ONE_N4SID = PublishedFit(
    "thesis: n4sid, 1 LLM",
    "Table 4.5, operating point, validation",
    {"xi": 91.52, "xi_dot": 90.22, "zeta": 91.31, "zeta_dot": 90.57, "F_H": 90.85, "F_p": 90.81},
)
_COUNTERPARTS = {
    ("surrogate", "parameter"): SURROGATE,
    ("surrogate", "theta"): SURROGATE,
    ("n4sid", "output"): N4SID_OUTPUT,
    ("n4sid", "parameter"): N4SID_PARAMETER,
}
BEST_CONTACT_FORCE = max(column.fits["F_p"] for column in _COUNTERPARTS.values())
"""The best FIT of F_p on unseen whole-range data in the thesis [%] (Table 4.5, also Table 4.6)."""


def counterpart(labels: Mapping[str, Any]) -> PublishedFit | None:
    """Return the thesis's column for a model with these score labels, None where it has none."""
    if labels.get("llms") != 4:
        return None
    return _COUNTERPARTS.get((labels.get("model", ""), labels.get("blending") or ""))


SURROGATE_PARAMETERS: Mapping[str, tuple[float, ...]] = {
    "m_H": (16.97, 16.24, 15.20, 13.72),
    "m_M": (44.65, 36.24, 31.41, 27.33),
    "k_L": (155.64, 160.51, 178.05, 344.24),
    "c_L": (51.28, 45.45, 36.42, 30.42),
    "r_M": (0.27, 0.11, 0.03, 0.19),
    "k_W": (7998.42, 7999.22, 7999.53, 7999.50),
    "c_W": (2501.77, 2500.72, 2500.38, 2500.42),
}
"""Identified surrogate, LLM 1 to 4 (Table 4.3), SI units."""

REAL_TIME_FACTORS_BY_DATA: Mapping[str, tuple[float | None, ...]] = {
    "white_box": (272.13, 257.32, 256.92, 240.97),
    "surrogate": (0.135, 0.132, 0.185, 0.171),
    "n4sid": (0.666, 0.663, 0.694, 0.695),
    "lolimot": (None, None, 0.889, None),
}
"""Simulation time over simulated time on OP65 training and validation, whole-range training and validation
data (Table 4.4); n4sid with output blending, low-pass and look-up table (Remark 4.6.2), LOLIMOT
on 120 s that it was trained on (eq. 4.4)."""
REAL_TIME_FACTORS: Mapping[str, tuple[float, float]] = {
    kind: (min(known), max(known))
    for kind, factors in REAL_TIME_FACTORS_BY_DATA.items()
    if (known := [factor for factor in factors if factor is not None])
}
"""The smallest and the largest of them."""

LARGEST_RELATIVE_ERRORS: Mapping[str, float] = {"linear": 35.0, "surrogate": 30.0, "n4sid_output": 22.5}
"""Maximum relative error of F_p on whole-range data [%]: linearised at OP45 (4.8), 4 LLM (4.4.1, 4.5.1)."""

"""Settings of a surrogate that make no sense are refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from identification.surrogate import REASONED_START, SurrogateSettings


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"validity": "gaussian"}, "node table"),
        ({"offsets": "affine"}, "affine offsets belong"),
        ({"blending": "matrices", "deviation_gain": 0.5}, "deviation"),
        ({"blending": "matrices", "validity": "cubic_warp"}, "warp"),
        ({"training_rows": (10, 5)}, "training_rows"),
        ({"output_error": {"stages": (0, 4)}}, "stage"),
        ({"blending": "matrices", "warp": (1.0, 0.0)}, "cubic_warp"),
        ({"deviation_gain": float("nan")}, "deviation_gain is nan"),
        ({"warp": (0.0, float("inf"))}, "warp is inf"),
        (
            {"output_error": {"contact_force_weight": float("inf")}},
            "output_error.contact_force_weight is inf",
        ),
        ({"frequency_response": {"lowest": 40.0, "highest": 0.4}}, "40 Hz, is not below highest"),
        ({"frequency_response": {"seed": -1}}, "greater than or equal to 0"),
        ({"output_error": {"single_start": {"m_h": 8.0}}}, "has no m_h.*lacks m_H, m_M, k_L"),
        (
            {"structure": "chain7", "output_error": {"single_start": {**REASONED_START, "m_M": -20.0}}},
            "m_M = -20 lies outside 5 .. 50 kg",
        ),
    ],
)
def test_settings_that_contradict_each_other_are_refused(changes: dict[str, object], word: str) -> None:
    with pytest.raises(ValidationError, match=word):
        SurrogateSettings(**changes)

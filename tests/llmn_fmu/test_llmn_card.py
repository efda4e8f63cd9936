"""What the model card says about a schedule that follows an output."""

from __future__ import annotations

import networks

from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import interface
from fmu_builder.parameter_set import ParameterSet


def card(gain: float) -> str:
    content = networks.network(1, "scheduled_equilibrium", "parameter", "hat").model_dump()
    content["partition"] |= {"deviation_output": "y_2", "deviation_gain": gain}
    parameter_set = ParameterSet(**content)
    return model_card(parameter_set, interface(parameter_set))


def test_the_deviation_in_the_schedule_is_named() -> None:
    assert "To u_1 the schedule adds 0.25 times the deviation of y_2" in card(0.25)
    assert "the schedule adds" not in card(0.0)

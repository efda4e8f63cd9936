"""What the model card says about a schedule that follows an output, and about error bands."""

from __future__ import annotations

import networks

from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import interface
from fmu_builder.parameter_set import ParameterSet, ResidualBands


def card(gain: float) -> str:
    content = networks.network(1, "scheduled_equilibrium", "parameter", "hat").model_dump()
    content["partition"] |= {"deviation_output": "y_2", "deviation_gain": gain}
    parameter_set = ParameterSet(**content)
    return model_card(parameter_set, interface(parameter_set))


def test_the_deviation_in_the_schedule_is_named() -> None:
    assert "To u_1 the schedule adds 0.25 times the deviation of y_2" in card(0.25)
    assert "the schedule adds" not in card(0.0)


def test_error_bands_have_units_and_are_called_estimates_however_many_records_they_come_from() -> None:
    network = networks.network(1, "scheduled_equilibrium", "parameter", "hat")
    output, scheduling = network.outputs[1], network.inputs[network.scheduling_index]
    sizes = ((0.5, None), (0.25, 4.0))
    bands = ResidualBands(
        model_hash=network.model_hash(), output=output.name, positions=(0.5, 1.0, 2.5),
        frequencies=(0.0, 15.0, 500.0), coverage=0.95, rms=sizes, bound=sizes, total=(0.75, 5.0),
        amplitude=((1.25, None), (0.5, 0.875)), phase=((None, None), (-0.0625, 0.0)),
        seconds=(40.0, 39.0), held_out=("first", "second"),
    )  # fmt: skip
    shown = network.replaced(residual_bands=(bands,))
    text = model_card(shown, interface(shown))
    for part in (
        f"(first, second) do not exceed [{output.unit}];",
        "Bounds are estimates",
        f"<th>{scheduling.name} [{scheduling.unit}]</th>",
        "<td>0.5</td><td>no data</td>",
        "<td>0.25 (0.5, -0.0625)</td><td>4 (0.875, 0)</td>",
    ):
        assert part in text

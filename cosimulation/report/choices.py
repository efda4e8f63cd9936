"""What was chosen automatically, as tables show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cosimulation.settings import toml_value
from identification.choice import Choice

ORDER_RULE = (
    "The strength of a singular value is its size against noise. On the logarithmic scale, nothing counted "
    "below the level that noise alone would show, the order is where the last drop ends that is at least "
    "half as high as the largest."
)


@dataclass(frozen=True)
class ChoiceRow:
    """One choice.

    Attributes:
        setting: As the settings file of `llmn identify` writes it.
        place: What it holds for.
        reason: Why.
    """

    setting: str
    place: str
    reason: str


def choice_rows(choices: Sequence[Choice], everything: str = "all") -> list[ChoiceRow]:
    """Return choices as rows of a table.

    Args:
        choices: The choices.
        everything: What a choice without a place holds for.
    """
    return [
        ChoiceRow(f"{one.name} = {toml_value(one.value)}", one.place or everything, one.reason)
        for one in choices
    ]

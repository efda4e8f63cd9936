"""Things that are chosen automatically: what, why, and which setting overrides it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Choice:
    """One thing that was chosen automatically.

    Attributes:
        name: Name of the setting that overrides it.
        value: What was chosen.
        reason: Why, for a person.
        place: What it holds for, such as one local model; "" for everything.
    """

    name: str
    value: Any
    reason: str
    place: str = ""

    def __str__(self) -> str:
        return f"{self.name} = {self.value}: {self.reason}"

    def record(self) -> dict[str, Any]:
        """Return it as JSON can hold it; the place only where there is one."""
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        found = {"name": self.name, "value": value, "reason": self.reason}
        return {**found, "place": self.place} if self.place else found

"""The white-box model's parameter sets, read from `parameters.json` beside this file."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_builder.errors import LlmnError, Problem

PARAMETERS_FILE = Path(__file__).parent / "parameters.json"


@dataclass(frozen=True)
class Parameter:
    """One physical parameter with its meaning and origin."""

    name: str
    value: float
    unit: str
    description: str
    provenance: str


@dataclass(frozen=True)
class PhysicalParameters:
    """A complete set of parameters of the white-box model.

    Attributes:
        name: `A`, `A60`, `B` or `Blow`; made-up sets keep the name they came from.
        description: What the set is for.
        entries: All parameters in the order of the C structure `Parameters`.
    """

    name: str
    description: str
    entries: tuple[Parameter, ...]

    def __getitem__(self, name: str) -> float:
        return self.values()[name]

    def values(self) -> dict[str, float]:
        """Return name -> value in SI units."""
        return {entry.name: entry.value for entry in self.entries}

    def vector(self) -> NDArray[np.float64]:
        """Return the values in the order the C model reads them."""
        return np.array([entry.value for entry in self.entries])

    def changed(self, **values: float) -> PhysicalParameters:
        """Return a copy with other values for the named parameters.

        Raises:
            LlmnError: A name is not a parameter of the model (all such names at once).
        """
        mend = f"Use one of: {', '.join(self.values())}"
        unknown = [Problem(name, "is not a parameter of the white-box model", mend) for name in values]
        unknown = [problem for problem in unknown if problem.place not in self.values()]
        if unknown:
            raise LlmnError(unknown)
        entries = tuple(replace(e, value=float(values.get(e.name, e.value))) for e in self.entries)
        return replace(self, entries=entries)


@functools.cache
def parameter_document() -> Mapping[str, Any]:
    """Return `parameters.json` as it stands."""
    document: Mapping[str, Any] = json.loads(PARAMETERS_FILE.read_text(encoding="utf-8"))
    return document


def operating_point() -> dict[str, float]:
    """Return the start values of the inputs: contact position eta (m) and torque M_pa (N.m)."""
    return {name: float(item["value"]) for name, item in parameter_document()["operating_point"].items()}


def _entry(name: str, item: Mapping[str, Any], lineage: tuple[str, ...]) -> Parameter:
    """Return one parameter of the set `lineage[0]`, which falls back on the sets it is based on."""
    value: Any = item.get("value")
    for ancestor in reversed(lineage):
        value = item.get("values", {}).get(ancestor, value)
    notes = [note for ancestor in lineage if (note := item.get("notes", {}).get(ancestor))]
    provenance = "; ".join([item["provenance"], *notes[:1]])
    return Parameter(name, float(value), item["unit"], item["description"], provenance)


@functools.cache
def parameter_sets() -> Mapping[str, PhysicalParameters]:
    """Return the sets A, A60, B and Blow in the order of the FMU's parameter `preset`."""
    document = parameter_document()
    sets: dict[str, PhysicalParameters] = {}
    for name, item in document["sets"].items():
        lineage = (name, *((item["based_on"],) if "based_on" in item else ()))
        entries = tuple(_entry(key, value, lineage) for key, value in document["parameters"].items())
        sets[name] = PhysicalParameters(name, item["description"], entries)
    return sets


def parameters_header() -> str:
    """Return the generated C header with all sets; numbers read back to the same bits."""
    lines = ["/* Generated from parameters.json: data only. */", ""]
    lines += [f"enum {{ PARAMETER_SET_COUNT = {len(parameter_sets())} }};", ""]
    lines += ["static const Parameters parameter_sets[PARAMETER_SET_COUNT] = {"]
    for name, chosen in parameter_sets().items():
        lines += ["    {", f"        /* {name}: {chosen.description} */"]
        lines += [f"        .{entry.name} = {entry.value!r}," for entry in chosen.entries]
        lines += ["    },"]
    return "\n".join([*lines, "};", ""])

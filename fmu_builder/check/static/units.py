"""Units and types: defined once, used only where they are defined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fmu_builder.check.description import Description, number, place_of
from fmu_builder.check.finding import Finding, Severity, standard

_UNITS = standard("2.2.2")
_TYPES = standard("2.2.3")


def _definition_findings(description: Description) -> Iterator[Finding]:
    root = description.root
    for path, kind, paragraph in (
        ("UnitDefinitions/Unit", "unit", _UNITS),
        ("TypeDefinitions/SimpleType", "type", _TYPES),
    ):
        elements = list(root.iterfind(path))
        for name, count in Counter(element.get("name", "") for element in elements).items():
            if count > 1:
                line = next(e.sourceline for e in elements if e.get("name") == name)
                what = f"the {kind} {name!r} is defined {count} times"
                yield Finding(
                    Severity.ERROR, f"{kind}-definition", place_of(line), what, paragraph, "Define it once"
                )
    for element in root.iterfind("UnitDefinitions/Unit//*"):
        factor = number(element.get("factor"))
        if factor == 0.0:
            yield Finding(
                Severity.ERROR, "unit-definition", place_of(element.sourceline), "the factor is 0", _UNITS,
                "Give the factor of the conversion",
            )  # fmt: skip


def _item_findings(description: Description) -> Iterator[Finding]:
    for simple in description.root.iterfind("TypeDefinitions/SimpleType"):
        for key in ("name", "value"):
            found = Counter(item.get(key) for item in simple.iterfind("Enumeration/Item"))
            for text, count in found.items():
                if count > 1:
                    place = place_of(simple.sourceline)
                    what = f"the type {simple.get('name')!r} has {count} items with the {key} {text!r}"
                    yield Finding(
                        Severity.ERROR, "type-definition", place, what, _TYPES, "Give each item its own"
                    )


def unit_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with units and types, and with their use by variables and types."""
    yield from _definition_findings(description)
    yield from _item_findings(description)
    for variable in description.variables:
        declared = variable.own.get("declaredType")
        if declared is not None and declared not in description.types:
            what = f"the type {declared!r} is not defined"
            yield Finding(
                Severity.ERROR, "type-undefined", variable.place, what, _TYPES, "Define it, or name another"
            )
        elif declared is not None and description.types[declared][0] != variable.type:
            what = f"is {variable.type}, but its type {declared!r} is {description.types[declared][0]}"
            yield Finding(
                Severity.ERROR, "type-undefined", variable.place, what, _TYPES, "Name a type of the same kind"
            )
        attributes = description.with_type(variable)
        unit, shown = attributes.get("unit"), attributes.get("displayUnit")
        if unit is not None and unit not in description.units:
            what = f"the unit {unit!r} is not defined"
            mend = "Define it in UnitDefinitions with its base units"
            yield Finding(Severity.ERROR, "unit-undefined", variable.place, what, _UNITS, mend)
        elif shown is not None and shown not in description.units.get(unit or "", frozenset()):
            what = f"the display unit {shown!r} is not defined for the unit {unit!r}"
            mend = "Define it as DisplayUnit of the unit"
            yield Finding(Severity.ERROR, "unit-undefined", variable.place, what, _UNITS, mend)

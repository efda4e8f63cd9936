"""Every reason to refuse a parameter set, found in one pass.

A part that cannot be read is reported and left out; the other parts are still checked against each other.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, cast

from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from fmu_builder.errors import Problem
from fmu_builder.files import unwritable_character
from fmu_builder.parameter_set.components import (
    DerivedOutput,
    InputSignal,
    LocalLinearModel,
    OutputSignal,
    ResidualBands,
)
from fmu_builder.parameter_set.consistency import Parts, consistency_problems

FORMAT = 3
"""The version of the format this program writes; it reads all up to it."""

_FIRST_FORMAT = {"certificate": 2, "trained_region": 3, "residual_bands": 3}
"""Fields that an earlier format does not have, and the first one that has them."""

T = TypeVar("T")
_LISTS: dict[str, type[Any]] = {
    "inputs": InputSignal,
    "outputs": OutputSignal,
    "local_models": LocalLinearModel,
    "derived_outputs": DerivedOutput,
    "residual_bands": ResidualBands,
}


def problems_of(content: Mapping[str, Any], fields: Mapping[str, FieldInfo]) -> list[Problem]:
    """Return everything that is wrong with the fields of a parameter set; empty when it is valid.

    Args:
        content: Field name to value, as read from JSON or passed to the constructor.
        fields: The fields of the parameter set.
    """
    version = content.get("format", FORMAT)
    if type(version) is not int or not 1 <= version <= FORMAT:
        what = f"format version {version!r} is unknown"
        return [Problem("format", what, f"Use a program that knows it, or a file of format 1 to {FORMAT}")]
    problems = [
        Problem(name, "unknown field", "Remove it")
        for name in content
        if name not in fields or _FIRST_FORMAT.get(name, 1) > version
    ]
    read: dict[str, Any] = {}
    for name, field in fields.items():
        if name == "format":
            continue
        if name not in content:
            if field.is_required():
                problems.append(Problem(name, "missing", "Add it"))
            else:
                read[name] = field.get_default(call_default_factory=True, validated_data={})
        elif name in _LISTS and isinstance(content[name], list | tuple):
            read[name] = [
                _read(TypeAdapter(_LISTS[name]), item, f"{name}[{index}]", problems)
                for index, item in enumerate(content[name])
            ]
        else:
            read[name] = _read(
                TypeAdapter(cast(Any, field.rebuild_annotation())), content[name], name, problems
            )
    for name in sorted(read):
        problems += _unusable(read[name], name)
    problems += consistency_problems(Parts(read))
    return problems


def _read(adapter: TypeAdapter[T], value: Any, place: str, problems: list[Problem]) -> T | None:
    """Validate one part; report what is wrong and return it without its unknown fields, or None."""
    try:
        return adapter.validate_python(value)
    except ValidationError as refused:
        errors = refused.errors(include_url=False)
    problems.extend(_problem(place, error) for error in errors)
    if any(error["type"] != "extra_forbidden" for error in errors):
        return None
    known = copy.deepcopy(value)
    for error in errors:
        owner = known
        for key in error["loc"][:-1]:
            owner = owner[key]
        del owner[error["loc"][-1]]
    return adapter.validate_python(known)


def _problem(place: str, error: Any) -> Problem:
    steps = [f"[{key}]" if isinstance(key, int) else f".{key}" for key in error["loc"]]
    where = place + "".join(steps)
    if error["type"] == "extra_forbidden":
        return Problem(where, "unknown field", "Remove it")
    if error["type"] == "missing":
        return Problem(where, "missing", "Add it")
    what = re.sub(r"^Input should", "should", error["msg"])
    return Problem(where, what[:1].lower() + what[1:], "Correct it")


def _unusable(item: Any, place: str) -> Iterator[Problem]:
    """Yield every number that is not finite and every text that cannot go into a file."""
    if isinstance(item, float):
        if not math.isfinite(item):
            yield Problem(place, f"is {item!r}, not a finite number", "Give a finite number")
    elif isinstance(item, str):
        yield from _unwritable(item, place)
    elif isinstance(item, list | tuple):
        for index, part in enumerate(item):
            yield from _unusable(part, f"{place}[{index}]")
    elif isinstance(item, dict):
        for key in item:
            shown = key if unwritable_character(key) is None else ascii(key)
            yield from _unwritable(key, f"{place}, key {shown}")
            yield from _unusable(item[key], f"{place}.{shown}")
    elif hasattr(type(item), "model_fields"):
        for name in type(item).model_fields:
            yield from _unusable(getattr(item, name), f"{place}.{name}")


def _unwritable(text: str, place: str) -> Iterator[Problem]:
    found = unwritable_character(text)
    if found is not None:
        yield Problem(place, f"holds the character {found}, which XML cannot carry", "Leave it out")

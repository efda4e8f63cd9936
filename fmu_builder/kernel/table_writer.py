"""The tables of a network as a C header: data only, printed so that every bit comes back."""

from __future__ import annotations

from collections.abc import Iterable

from fmu_builder.kernel.tables import ARRAYS, INDICES, NUMBERS, SIZES, Tables

_PER_LINE = 4


def tables_header(tables: Tables) -> str:
    """Return the text of tables.h: `static const Tables tables`, and its sizes as `TABLES_...` constants."""
    lines = ["/* The numbers of one network; written by a program. Struct and meaning: kernel.h. */", ""]
    sizes = {**tables.sizes, "state_size": tables.state_size}
    lines += ["enum {", *(f"    TABLES_{name.upper()} = {sizes[name]}," for name in (*SIZES, "state_size"))]
    lines[-1] = lines[-1].rstrip(",")
    lines += ["};", "", f"#define TABLES_SAMPLE_TIME {float(tables.sample_time)!r} /* s */", ""]
    for name in ARRAYS:
        lines += _array("double", name, (repr(float(value)) for value in tables.arrays[name]))
    for name in INDICES:
        lines += _array("int", name, (str(int(value)) for value in tables.indices[name]))
    fields = [f"{tables.sizes[name]}" for name in SIZES]
    fields += [repr(float(tables.numbers[name])) for name in NUMBERS]
    fields += [f"table_{name}" if tables.arrays[name].size else "0" for name in ARRAYS]
    fields += [f"table_{name}" if tables.indices[name].size else "0" for name in INDICES]
    names = (*SIZES, *NUMBERS, *ARRAYS, *INDICES)
    entries = [f"    .{name} = {field}" for name, field in zip(names, fields, strict=True)]
    return "\n".join([*lines, "static const Tables tables = {", ",\n".join(entries), "};", ""])


def _array(type_name: str, name: str, numbers: Iterable[str]) -> list[str]:
    entries = list(numbers)
    if not entries:
        return []
    rows = [", ".join(entries[start : start + _PER_LINE]) for start in range(0, len(entries), _PER_LINE)]
    body = ",\n".join(f"    {row}" for row in rows)
    return [f"static const {type_name} table_{name}[{len(entries)}] = {{", body, "};", ""]

"""The tables of a network as a C header: data only, printed so that every bit comes back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fmu_builder.kernel.chain import Chain
from fmu_builder.kernel.chain_parameters import CONTACT_STIFFNESS
from fmu_builder.kernel.tables import ARRAYS, INDICES, NUMBERS, SIZES, Tables
from fmu_builder.parameter_set import ParameterSet

_PER_LINE = 4


def tables_header(tables: Tables, made: Mapping[str, int] | None = None) -> str:
    """Return the text of tables.h: `static const Tables tables`, and its sizes as `TABLES_...` constants.

    Args:
        tables: The numbers.
        made: Name of an array -> numbers per node that the FMU makes itself, as `NODE_...` constants.
    """
    lines = ["/* The numbers of one network; written by a program. Struct and meaning: kernel.h. */", ""]
    certified = int(tables.numbers["certified_move"] > 0.0)
    sizes = {**tables.sizes, "state_size": tables.state_size, "certified": certified}
    lines += ["enum {", *(f"    TABLES_{name.upper()} = {size}," for name, size in sizes.items())]
    lines += [f"    NODE_{name.upper()} = {count}," for name, count in (made or {}).items()]
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


def theta_header(parameter_set: ParameterSet, chain: Chain) -> str:
    """Return the text of theta_tables.h: what chain.c needs to make tables of other physical parameters.

    `static const ChainTables theta_tables`, the head in the order of chain.c, and which terms of the derived
    outputs have the contact stiffness for a coefficient.
    """
    arrays, sizes = chain.arrays(), chain.sizes
    stiff = [
        int(term.parameter == CONTACT_STIFFNESS)
        for derived in parameter_set.derived_outputs
        for term in derived.terms
    ]
    lines = [
        "/* The physical parameters of one surrogate; written by a program. Struct and meaning: chain.c. */",
        "",
    ]
    lines += [
        "enum {",
        f"    THETA_PARAMETERS = {sizes['parameters']},",
        f"    THETA_TERMS = {len(stiff)}",
        "};",
        "",
    ]
    lines += _array("double", "head", (repr(float(value)) for value in chain.head_values()), "theta")
    for name in ("coefficients", "logarithmic"):
        lines += _array("int", name, (str(int(value)) for value in arrays[name]), "theta")
    for name in ("least", "largest"):
        lines += _array("double", name, (repr(float(value)) for value in arrays[name]), "theta")
    lines += _array("int", "stiffness_terms", map(str, stiff or [0]), "theta")
    entries = [f"    .{name} = {size}" for name, size in sizes.items()]
    entries.append(f"    .sample_time = {float(chain.sample_time)!r}")
    entries += [f"    .{name} = theta_{name}" for name in ("coefficients", "logarithmic", "least", "largest")]
    entries.append("    .weights = table_node_weights")
    return "\n".join([*lines, "static const ChainTables theta_tables = {", ",\n".join(entries), "};", ""])


def _array(type_name: str, name: str, numbers: Iterable[str], prefix: str = "table") -> list[str]:
    entries = list(numbers)
    if not entries:
        return []
    rows = [", ".join(entries[start : start + _PER_LINE]) for start in range(0, len(entries), _PER_LINE)]
    body = ",\n".join(f"    {row}" for row in rows)
    return [f"static const {type_name} {prefix}_{name}[{len(entries)}] = {{", body, "};", ""]

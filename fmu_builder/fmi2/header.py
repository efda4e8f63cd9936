"""variables.h: the interface as data for the C code."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fmu_builder.fmi2.interface import Interface
from fmu_builder.fmi2.variable import Variable

_LARGEST = 1.7976931348623157e308
_PER_LINE = 8


def _array(kind: str, name: str, interface: Interface, item: Callable[[Variable], str]) -> Iterator[str]:
    entries = [item(variable) for variable in interface.variables]
    yield f"static const {kind}{name}[VARIABLE_COUNT] = {{"
    for start in range(0, len(entries), _PER_LINE):
        yield f"    {', '.join(entries[start : start + _PER_LINE])},"
    yield "};"


def _names(interface: Interface) -> Iterator[str]:
    """Yield all names as one text: a table of pointers would have to be relocated on every platform."""
    yield "static const char variable_names[] ="
    yield from (f'    "{interface.shown_name(variable)}\\0"' for variable in interface.variables)
    yield "    ;"
    yield "#define variable_name(reference) text_at(variable_names, (reference))"


def _states(interface: Interface) -> Iterator[str]:
    """Yield the table of the continuous states, in the order of their derivatives in the model structure."""
    by_name = {variable.name: variable for variable in interface.variables}
    rows = [
        (v.derivative_of, v.name, by_name[v.derivative_of].nominal or 1.0)
        for v in interface.variables
        if v.derivative_of is not None
    ]
    yield "static const ContinuousState continuous_state[STATE_SLOTS] = {"
    for state, rate, nominal in rows:
        yield f"    {{VARIABLE_{state}, VARIABLE_{rate}, {float(nominal)!r}}},"
    if not rows:
        yield "    {0U, 0U, 0.0}, /* none; an array cannot be empty */"
    yield "};"


def variables_header(interface: Interface, guid: str) -> str:
    """Return the text of variables.h: names, kinds, start values and limits by value reference.

    Behind them stand the continuous states in the order of model exchange.

    Args:
        interface: The interface.
        guid: The GUID that `interface.guid` gives for the model.
    """
    positions = [f"    VARIABLE_{v.name} = {k}," for k, v in enumerate(interface.variables)]
    minimum = {v.name: -_LARGEST if v.minimum is None else float(v.minimum) for v in interface.variables}
    maximum = {v.name: _LARGEST if v.maximum is None else float(v.maximum) for v in interface.variables}
    lines = [
        "/* Generated: the variables of this FMU by value reference. */",
        '#include "variable_kinds.h"',
        "",
        f'#define MODEL_IDENTIFIER "{interface.model_identifier}"',
        f'#define MODEL_GUID "{guid}"',
        "",
        "enum {",
        *positions,
        f"    VARIABLE_COUNT = {len(interface.variables)},",
        f"    INPUT_COUNT = {len(interface.inputs)},",
        f"    PARAMETER_COUNT = {len(interface.of_causality('parameter'))},",
        f"    CONTINUOUS_STATES = {len(interface.states)},",
        f"    STATE_SLOTS = {max(1, len(interface.states))},",
        f"    EVENT_INDICATORS = {interface.event_indicators}",
        "};",
        "",
        *_names(interface),
        *_array("unsigned char ", "variable_type", interface, lambda v: f"TYPE_{v.type.upper()}"),
        *_array(
            "unsigned char ", "variable_causality", interface, lambda v: f"CAUSALITY_{v.causality.upper()}"
        ),
        *_array(
            "unsigned char ",
            "variable_variability",
            interface,
            lambda v: f"VARIABILITY_{v.variability.upper()}",
        ),
        *_array("double ", "variable_start", interface, lambda v: repr(float(v.start or 0.0))),
        *_array("double ", "variable_minimum", interface, lambda v: repr(minimum[v.name])),
        *_array("double ", "variable_maximum", interface, lambda v: repr(maximum[v.name])),
        *_states(interface),
    ]
    return "\n".join(lines) + "\n"

"""Which signals of a network are the two sides of its contact, so that the pan-head can leave the wire."""

from __future__ import annotations

import ctypes

from fmu_builder.errors import ParameterSetError
from fmu_builder.parameter_set import DerivedOutput, ParameterSet

_RATE = "_dot"


class Contact(ctypes.Structure):
    """`Contact` of c/contact.h: positions of the pan-head's position and velocity among the outputs."""

    _fields_ = (("output", ctypes.c_int), ("rate", ctypes.c_int), ("half_tick", ctypes.c_double))


def contact_of(parameter_set: ParameterSet) -> Contact | None:
    """Return where a network has a contact that can open, or None when it has none that could.

    A contact is a derived output k (y - u), the force of a spring between an output y and the scheduling
    input u. The velocity of y, named y_dot, is an output, too, and no input acts on either at once.
    """
    names = [output.name for output in parameter_set.outputs]
    table = parameter_set.node_table
    models = (*parameter_set.local_models, *(table.models if table is not None else ()))
    for derived in parameter_set.derived_outputs:
        name = _pressed(derived, parameter_set.partition.scheduling)
        if name in names and f"{name}{_RATE}" in names:
            rows = names.index(name), names.index(f"{name}{_RATE}")
            if not any(entry != 0.0 for model in models for row in rows for entry in model.D[row]):
                return Contact(rows[0], rows[1], 0.5 * parameter_set.sample_time)
    return None


def _pressed(derived: DerivedOutput, wire: str) -> str:
    """Return y of k (y - wire), empty when a derived output is something else."""
    terms = derived.terms
    pairs = {(term.sign, term.signal == wire) for term in terms}
    if len(terms) != 2 or pairs != {(1, False), (-1, True)} or terms[0].parameter != terms[1].parameter:
        return ""
    return next(term.signal for term in terms if term.signal != wire)


def no_contact() -> ParameterSetError:
    """Return the refusal of a start in which the wire would have to pull."""
    what = "the pan-head is not on the wire in the steady state of the start inputs"
    return ParameterSetError.of("unilateral contact", what, "Start with a larger torque")


def contact_header(contact: Contact | None) -> str:
    """Return the text of contact.h: the contact, and the variable that lets it open (negative: none)."""
    switch = "-1" if contact is None else "VARIABLE_unilateral"
    if contact is None:
        contact = Contact(-1, -1, 0.0)
    return "\n".join(
        (
            "/* The contact of one network; written by a program. Struct and meaning: contact.c. */",
            "",
            f"enum {{ CONTACT_SWITCH = {switch} }};",
            "",
            f"static const Contact contact = {{{contact.output}, {contact.rate}, {contact.half_tick!r}}};",
            "",
        )
    )

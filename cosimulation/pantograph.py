"""What is known of every pantograph here: names, units, and the two forces that follow from the motion."""

from __future__ import annotations

from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter

INPUTS = ("eta", "M_pa")
OUTPUTS = ("xi", "xi_dot", "zeta", "zeta_dot")
FORCES = ("F_H", "F_p")
SIGNALS = (*OUTPUTS, *FORCES)
TORQUE = 1310.9
"""Operating point of M_pa [N.m]."""

DESCRIPTIONS = {
    "eta": "height of the contact wire",
    "M_pa": "torque of the pneumatic actuator on the lower arm",
    "xi": "height of the pan-head",
    "xi_dot": "velocity of the pan-head",
    "zeta": "height of the crossbar",
    "zeta_dot": "velocity of the crossbar",
}


def operating_point_name(height: float) -> str:
    """Return the thesis's name of a height at the operating point of the torque, e.g. OP25 (eq. 4.1)."""
    number = (height - 0.25) / 0.25
    whole = round(number)
    return f"OP{whole}5" if abs(number - whole) < 1e-9 else f"{height:.4g} m"


def force_outputs(k_E: float, k_C: float, c_C: float) -> tuple[DerivedOutput, DerivedOutput]:
    """Return F_H and F_p as outputs derived from motion (thesis eq. 3.14-3.15, Remark 2.2.1).

    Args:
        k_E: Stiffness of the carbon contact [N/m].
        k_C: Stiffness of the collector head's suspension [N/m].
        c_C: Its damping [N.s/m].
    """
    suspension = {
        "k_C": NamedParameter(
            value=k_C, unit="N/m", description="stiffness of the collector head's suspension"
        ),
        "c_C": NamedParameter(
            value=c_C, unit="N.s/m", description="damping of the collector head's suspension"
        ),
    }
    contact = {"k_E": NamedParameter(value=k_E, unit="N/m", description="stiffness of the carbon contact")}
    crossbar_force = DerivedOutput(
        name="F_H",
        unit="N",
        description="force between crossbar and collector head",
        terms=(
            DerivedTerm(signal="zeta", parameter="k_C", sign=1),
            DerivedTerm(signal="xi", parameter="k_C", sign=-1),
            DerivedTerm(signal="zeta_dot", parameter="c_C", sign=1),
            DerivedTerm(signal="xi_dot", parameter="c_C", sign=-1),
        ),
        parameters=suspension,
    )
    contact_force = DerivedOutput(
        name="F_p",
        unit="N",
        description="contact force",
        terms=(
            DerivedTerm(signal="xi", parameter="k_E", sign=1),
            DerivedTerm(signal="eta", parameter="k_E", sign=-1),
        ),
        parameters=contact,
    )
    return crossbar_force, contact_force

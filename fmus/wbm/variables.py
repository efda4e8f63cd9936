"""The variables of the white-box model's FMU; the C enumerations follow this order."""

from __future__ import annotations

from collections.abc import Iterator

from fmu_builder.fmi2.interface import Interface
from fmu_builder.fmi2.variable import Variable
from fmus.wbm.parameters import operating_point, parameter_document, parameter_sets

MODEL_IDENTIFIER = "pantograph_wbm"
INPUTS = ("eta", "M_pa")
STATES = ("phi_1", "phi_1_dot", "delta", "delta_dot", "xi", "xi_dot")
DEFAULT_INNER_STEP = 5e-4
LARGEST_INNER_STEP = 0.01

_ANGLES = ("phi_1", "delta")
_MOTION = ("phi_1", "phi_1_dot", "delta", "delta_dot")


def _inputs() -> tuple[Variable, ...]:
    start = operating_point()
    height = "contact position: height of the wire where the pan-head touches it; operating range"
    torque = "torque of the pneumatic drive on the lower arm"
    return (
        Variable(
            name="eta", causality="input", unit="m", description=height,
            start=start["eta"], minimum=0.5, maximum=2.5, nominal=1.0,
        ),
        Variable(
            name="M_pa", causality="input", unit="N.m", description=torque,
            start=start["M_pa"], minimum=0.0, maximum=2000.0, nominal=1000.0,
        ),
    )  # fmt: skip


def _output(
    name: str, unit: str, nominal: float, description: str, dependencies: tuple[str, ...]
) -> Variable:
    return Variable(
        name=name,
        causality="output",
        unit=unit,
        nominal=nominal,
        description=description,
        dependencies=dependencies,
    )


def _outputs() -> tuple[Variable, ...]:
    force = "force of the collector head's suspension, k_C (zeta - xi) + c_C (zeta_dot - xi_dot)"
    contact = "contact force, k_E (xi - eta); negative: it pulls, unless the contact is unilateral"
    drift = "horizontal position of the crossbar less the middle of its static range"
    return (
        _output("xi", "m", 1.0, "position of the pan-head", ("xi",)),
        _output("xi_dot", "m/s", 1.0, "velocity of the pan-head", ("xi_dot",)),
        _output("zeta", "m", 1.0, "position of the crossbar", _ANGLES),
        _output("zeta_dot", "m/s", 1.0, "velocity of the crossbar", _MOTION),
        _output("F_H", "N", 100.0, force, (*_MOTION, "xi", "xi_dot")),
        _output("F_p", "N", 100.0, contact, ("eta", "xi")),
        _output("phi_1", "rad", 0.1, "angle of the lower arm against the horizontal", ("phi_1",)),
        _output("phi_1_dot", "rad/s", 1.0, "angular velocity of the lower arm", ("phi_1_dot",)),
        _output("delta", "rad", 0.01, "elastic bend of the upper arm at the knee", ("delta",)),
        _output("delta_dot", "rad/s", 1.0, "rate of the elastic bend", ("delta_dot",)),
        _output("crossbar_drift", "m", 0.1, drift, _ANGLES),
    )


def _physical() -> Iterator[Variable]:
    """Yield the parameters in the order of the C structure `Parameters`."""
    default = parameter_sets()[parameter_document()["default"]]
    for entry in default.entries:
        item = parameter_document()["parameters"][entry.name]
        description = f"{entry.description}; at its start value the preset decides"
        if item.get("type") == "Boolean":
            start = bool(entry.value)
            yield Variable(
                entry.name, type="Boolean", causality="parameter", description=description, start=start
            )
            continue
        low, high = item["limits"]
        yield Variable(
            name=entry.name,
            causality="parameter",
            unit=entry.unit,
            description=description,
            start=entry.value,
            minimum=low,
            maximum=high,
            nominal=abs(entry.value) or None,
        )


def _parameters() -> tuple[Variable, ...]:
    names = tuple(parameter_sets())
    default = names.index(parameter_document()["default"]) + 1
    preset = (
        "parameter set; A reproduces the thesis's resonances, Blow has a real collector head. A physical"
        " parameter with another value than its start overrides it"
    )
    return (
        Variable(
            name="preset", type="Enumeration", causality="parameter", start=default, enumeration=names,
            description=preset,
        ),
        Variable(
            name="inner_step", causality="parameter", unit="s", start=DEFAULT_INNER_STEP,
            minimum=1e-6, maximum=LARGEST_INNER_STEP, nominal=DEFAULT_INNER_STEP,
            description="co-simulation: Runge-Kutta step (fourth order) and tick of the inputs",
        ),
    )  # fmt: skip


def _derivatives() -> tuple[Variable, ...]:
    units = {"phi_1": "rad/s", "delta": "rad/s", "xi": "m/s"}
    acceleration = {"phi_1": "rad/s2", "delta": "rad/s2", "xi": "m/s2"}
    arms = (*STATES, "M_pa")
    acting = {"phi_1": arms, "delta": arms, "xi": (*STATES, "eta")}
    listed: list[Variable] = []
    for name in units:
        pair = ((name, units[name], (f"{name}_dot",)), (f"{name}_dot", acceleration[name], acting[name]))
        for state, unit, dependencies in pair:
            text = f"time derivative of {state}"
            variable = Variable(
                name=f"der_{state}",
                unit=unit,
                description=text,
                derivative_of=state,
                structured=f"der({state})",
                dependencies=dependencies,
            )
            listed.append(variable)
    return tuple(listed)


OUTPUTS = tuple(variable.name for variable in _outputs())


def interface(naming: str = "flat") -> Interface:
    """Return the interface of the FMU `pantograph_wbm`; with structured naming it has der(xi) for der_xi."""
    return Interface(
        model_identifier=MODEL_IDENTIFIER,
        model_name="Pantograph, white-box model",
        description=(
            "Planar multibody model of a single-arm pantograph with three degrees of freedom, from first "
            "principles; starts in the static equilibrium of its inputs. In co-simulation they are held "
            "over a communication step; in model exchange the importer integrates its six states"
        ),
        variables=(*_inputs(), *_outputs(), *_parameters(), *_derivatives(), *_physical()),
        states=STATES,
        naming=naming,
        default_step=0.001,
        stop_time=10.0,
        licence="MIT",
        event_indicators=1,
        author="the pantograph-llmn authors",
        copyright="(c) 2026 the pantograph-llmn authors",
    )

"""What the FMU of a network shows to the outside."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

from fmu_builder.fmi2 import Interface, Variable
from fmu_builder.kernel import (
    CONTACT_STIFFNESS,
    LARGEST_CONTACT_STIFFNESS,
    LEAST_CONTACT_STIFFNESS,
    chain_of,
    contact_of,
)
from fmu_builder.parameter_set import ParameterSet, StabilityProof

OUT_OF_RANGE = "out_of_range"
POLICIES = ("warn", "clamp", "error")
"""Items of the parameter `OUT_OF_RANGE`, numbered from 1 as in c/llmn_options.c."""
_KINDS = {
    "n4sid": "subspace-identified models",
    "surrogate": "surrogate models with physical parameters",
    "linear": "a linearisation",
    "lolimot": "a tree of local ARX models",
}


def interface(
    parameter_set: ParameterSet,
    model_identifier: str | None = None,
    naming: str = "flat",
    proof: StabilityProof | None = None,
) -> Interface:
    """Return the interface: inputs, outputs, derived outputs, validity_1..M, in_range, parameters, constants.

    The last parameters are out_of_range and, of a network with a contact, unilateral.

    Where stability is proved under a condition (`conditions`), outside_certificate follows in_range.

    Inputs start at the operating point, their limits are those seen in training. Outputs carry no limits:
    what was seen in training does not bound them. Parameters are the physical ones of a surrogate whose theta
    is blended: k_E, and `theta_NAME_I` of every local model I = 1, 2, ... The numbers in derived outputs that
    are no parameters are constants.

    Args:
        parameter_set: The network.
        model_identifier: C identifier of the FMU; by default the name of the parameter set.
        naming: "flat", or "structured": `validity[1]`, `theta[2].m_H`.
        proof: What its certificate of stability was found to prove.

    Raises:
        BuildError: A name or unit cannot be expressed; every problem is named.
    """
    count = len(parameter_set.local_models)
    name = parameter_set.name.replace("_", " ")
    description = (
        f"Local linear model network of {count} local {'model' if count == 1 else 'models'}"
        f" ({_KINDS[parameter_set.kind]}), {parameter_set.blending} blending,"
        f" sample time {parameter_set.sample_time!r} s"
    )
    return Interface(
        model_identifier=model_identifier or parameter_set.name,
        model_name=name,
        description=description,
        variables=tuple(_variables(parameter_set, proof)),
        naming=naming,
        default_step=parameter_set.sample_time,
        licence="program: MIT, see documentation/licenses; the model belongs to whoever identified it",
    )


def identity(parameter_set: ParameterSet) -> str:
    """Return the hash of what an FMU computes with, for its GUID: the model, and where it was trained.

    The region stands outside the model hash, which is what networks are compared by; an FMU watches it.
    """
    region, found = parameter_set.trained_region, parameter_set.model_hash()
    if region is None:
        return found
    return hashlib.sha256(f"{found} {region.model_dump_json()}".encode()).hexdigest()


def region_limits(parameter_set: ParameterSet) -> tuple[str, ...]:
    """Return the limits that in_range watches beside those of the inputs, in words; empty: none are known."""
    region = parameter_set.trained_region
    if region is None:
        return ()
    scheduling = parameter_set.inputs[parameter_set.scheduling_index]
    units = {one.name: one.unit for one in parameter_set.derived_outputs}
    rate = f"{scheduling.name} moved by at most {region.rate:.6g} {scheduling.unit}/s"
    spans = region.derived_outputs.items()
    return (rate, *(f"{name} was in {low:.6g} .. {high:.6g} {units[name]}" for name, (low, high) in spans))


def conditions(parameter_set: ParameterSet, proof: StabilityProof | None) -> tuple[str, ...]:
    """Return what takes a run out of what is proved of stability, in words; empty: nothing, or no proof."""
    if proof is None:
        return ()
    scheduling = parameter_set.inputs[parameter_set.scheduling_index]
    found = []
    if proof.rate is not None:
        faster = f"{proof.rate!r} {scheduling.unit}/s"
        found.append(f"{scheduling.name} has moved by more than {faster} from tick to tick since the start")
    if contact_of(parameter_set) is not None:
        found.append("the contact has opened since the start")
    if chain_of(parameter_set) is not None:
        found.append("physical parameters are not those identified")
    return tuple(found)


def _variables(parameter_set: ParameterSet, proof: StabilityProof | None) -> Iterator[Variable]:
    for signal in parameter_set.inputs:
        yield Variable(
            signal.name,
            causality="input",
            unit=signal.unit,
            description=signal.description,
            start=signal.operating_point,
            minimum=signal.minimum,
            maximum=signal.maximum,
            nominal=_size(signal.minimum, signal.maximum),
        )
    direct = {
        output.name: _direct_inputs(parameter_set, row) for row, output in enumerate(parameter_set.outputs)
    }
    for output in parameter_set.outputs:
        yield Variable(
            output.name,
            causality="output",
            unit=output.unit,
            description=output.description,
            nominal=_size(output.minimum, output.maximum),
            variability=_variability(direct[output.name]),
            dependencies=direct[output.name],
        )
    for derived in parameter_set.derived_outputs:
        acting: set[str] = set()
        for term in derived.terms:
            acting.update(direct.get(term.signal, (term.signal,)))
        names = tuple(name for name in parameter_set.input_names if name in acting)
        yield Variable(
            derived.name,
            causality="output",
            unit=derived.unit,
            description=derived.description,
            variability=_variability(names),
            dependencies=names,
        )
    for number, centre in enumerate(parameter_set.partition.centres, start=1):
        where = f"{parameter_set.partition.scheduling} = {centre:g}"
        what = f"Weight of local model {number} ({where}) at the last tick"
        yield Variable(
            f"validity_{number}",
            structured=f"validity[{number}]",
            causality="output",
            unit="1",
            description=what,
            variability=_variability(()),
        )
    yield Variable(
        "in_range",
        type="Boolean",
        causality="output",
        description=", ".join(
            (
                "Whether the inputs of all ticks of the last step lie in the trained range",
                *region_limits(parameter_set),
            )
        ),
    )
    if broken := conditions(parameter_set, proof):
        yield Variable(
            "outside_certificate",
            type="Boolean",
            causality="output",
            description=f"Whether {', or '.join(broken)}: of that no stability is proved",
        )
    parameters = tuple(_parameters(parameter_set))
    yield from parameters
    yield Variable(
        OUT_OF_RANGE,
        type="Enumeration",
        causality="parameter",
        description="What an input outside its trained limits does: it acts as it is with a warning, is held"
        " at the limit, or makes the call an error",
        start=1,
        enumeration=POLICIES,
    )
    if contact_of(parameter_set) is not None:
        yield Variable(
            "unilateral",
            type="Boolean",
            causality="parameter",
            description="Whether the contact can open: it never pulls, and"
            f" {parameter_set.partition.scheduling} acts only where it is touched",
            start=False,
        )
    yield from _constants(parameter_set, {variable.name for variable in parameters})


def _parameters(parameter_set: ParameterSet) -> Iterator[Variable]:
    """Yield k_E and theta, local model by local model: the order of c/llmn_theta.c."""
    chain = chain_of(parameter_set)
    if chain is None:
        return
    stiffness = chain.head[CONTACT_STIFFNESS]
    yield Variable(
        CONTACT_STIFFNESS,
        causality="parameter",
        variability="tunable",
        unit="N/m",
        description="Contact stiffness between wire and collector head",
        start=stiffness,
        minimum=min(LEAST_CONTACT_STIFFNESS, stiffness),
        maximum=max(LARGEST_CONTACT_STIFFNESS, stiffness),
        nominal=stiffness,
    )
    partition = parameter_set.partition
    for number, (centre, row) in enumerate(
        zip(partition.centres, chain.theta.tolist(), strict=True), start=1
    ):
        where = f"local model {number}, {partition.scheduling} = {centre:g}"
        for parameter, value in zip(chain.parameters, row, strict=True):
            yield Variable(
                f"theta_{parameter.name}_{number}",
                structured=f"theta[{number}].{parameter.name}",
                causality="parameter",
                variability="tunable",
                unit=parameter.unit,
                description=f"{parameter.description}; {where}",
                start=value,
                minimum=parameter.lower,
                maximum=parameter.upper,
                nominal=abs(value) or parameter.size,
            )


def _constants(parameter_set: ParameterSet, taken: set[str]) -> Iterator[Variable]:
    """Yield the numbers of the derived outputs once each; with another value under a known name, prefixed."""
    shown: dict[str, float] = {}
    signals = {*parameter_set.input_names, *parameter_set.output_names}
    for derived in parameter_set.derived_outputs:
        for name, number in derived.parameters.items():
            own = name
            if name in signals or shown.get(name, number.value) != number.value:
                own = f"{derived.name}_{name}"
            if own in shown or own in taken:
                continue
            shown[own] = number.value
            yield Variable(
                own,
                causality="local",
                variability="constant",
                initial="exact",
                unit=number.unit,
                description=number.description or f"Constant in {derived.name}",
                start=number.value,
            )


def _direct_inputs(parameter_set: ParameterSet, row: int) -> tuple[str, ...]:
    """Return the inputs that act on an output at once: those with a D that is not zero in some model."""
    table = parameter_set.node_table
    models = (*parameter_set.local_models, *(table.models if table is not None else ()))
    names = enumerate(parameter_set.input_names)
    return tuple(name for column, name in names if any(model.D[row][column] != 0.0 for model in models))


def _variability(direct: tuple[str, ...]) -> str:
    """Return how an output varies: it holds from tick to tick, unless inputs act on it at once."""
    return "continuous" if direct else "discrete"


def _size(low: float, high: float) -> float | None:
    largest = max(abs(low), abs(high))
    return largest if largest > 0.0 else None

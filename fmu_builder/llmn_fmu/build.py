"""From a parameter set to an FMU file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmu_builder.errors import BuildError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS, Interface, build_fmu, parameter_values
from fmu_builder.kernel import (
    SOURCES,
    blended_nodes,
    chain_of,
    contact_header,
    contact_of,
    tables_header,
    tables_of,
    theta_header,
    without_arrays,
)
from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import conditions, identity, interface
from fmu_builder.parameter_set import ParameterSet, StabilityProof

_C_FOLDER = Path(__file__).parent / "c"


def build_llmn(
    parameter_set: ParameterSet,
    output: Path,
    platforms: Sequence[str] = DEFAULT_PLATFORMS,
    model_identifier: str | None = None,
    naming: str = "flat",
    documentation: Mapping[str, bytes] | None = None,
    proof: StabilityProof | None = None,
) -> Path:
    """Build the FMI 2.0 FMU of a network: numbers as tables, the kernel as it is.

    It serves model exchange, with a time event at every tick, and co-simulation. The physical parameters of a
    surrogate whose theta is blended are tunable parameters of the FMU, which makes its tables anew from them.

    The parameter set goes into resources/parameter_set.json, identified parameters as SSV beside it, if there
    are any, a model card into documentation/index.html. The
    same arguments give the same bytes.

    Args:
        parameter_set: The network.
        output: The .fmu file.
        platforms: FMI 2.0 platform folders.
        model_identifier: C identifier of the FMU; by default the name of the parameter set.
        naming: "flat", or "structured" names of variables.
        documentation: Files below documentation/ beside the model card.
        proof: What the parameter set's certificate of stability was found to prove
            (`identification.stability.proved`). Only with it the FMU speaks of stability, in its model card
            and by outside_certificate: a certificate that nobody has proved counts for nothing.

    Returns:
        `output`.

    Raises:
        BuildError: Unknown platform or unit, a proof of another model, or C code that does not compile.
        OutputError: `output` cannot be written.
    """
    if proof is not None and proof.model_hash != parameter_set.model_hash():
        mend = "Prove the certificate of this parameter set"
        raise BuildError.of(f"proof of stability for {parameter_set.name}", "is of another model", mend)
    shown = interface(parameter_set, model_identifier, naming, proof)
    unity, headers = _network_headers(parameter_set, proof)
    headers["contact.h"] = contact_header(contact_of(parameter_set))
    return build_fmu(
        shown,
        identity(parameter_set),
        _C_FOLDER / unity,
        (_C_FOLDER, SOURCES),
        headers,
        output,
        platforms=platforms,
        resources={"parameter_set.json": parameter_set.compact_json().encode("utf-8"), **_values(shown)},
        documentation={
            **(documentation or {}),
            "index.html": model_card(parameter_set, shown, proof).encode("utf-8"),
        },
    )


def _values(shown: Interface) -> dict[str, bytes]:
    """Return identified.ssv: the parameters' start values, to change some of and give to an importer.

    Without out_of_range: some importers of SSV know no Enumeration.
    """
    parameters = [v for v in shown.of_causality("parameter") if v.type != "Enumeration"]
    known = {v.name: float(v.start) for v in parameters if v.start is not None}
    return {"identified.ssv": parameter_values("identified", shown, known)} if known else {}


def _certified_move(parameter_set: ParameterSet, proof: StabilityProof | None) -> float:
    """Return how far the clipped scheduling variable may move per tick; 0: nothing is to be watched."""
    if proof is not None and proof.move is not None:
        return proof.move
    low, high = parameter_set.partition.range
    return high - low if conditions(parameter_set, proof) else 0.0  # the whole range: any movement


def _network_headers(parameter_set: ParameterSet, proof: StabilityProof | None) -> tuple[str, dict[str, str]]:
    """Return the unity file, and the headers of numbers.

    Models at the nodes are left out where the FMU can make them, of physical parameters or of local models.
    """
    move = _certified_move(parameter_set, proof)
    tables = tables_of(parameter_set, move)
    chain, blend = chain_of(parameter_set), blended_nodes(parameter_set, move)
    if chain is not None:
        numbers = tables_header(without_arrays(tables, ("A", "B", "g")))
        headers = {"tables.h": numbers, "theta_tables.h": theta_header(parameter_set, chain)}
        return "surrogate.c", headers
    if blend is not None:
        return "blended.c", {"tables.h": tables_header(blend.tables, blend.numbers)}
    return "all.c", {"tables.h": tables_header(tables)}

"""`llmn prove`: the certificate of stability of a network, looked for, proved and stored."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosimulation.progress import SILENT, Reporter
from fmu_builder.errors import DataError, FmuError, Problem, SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import identity, interface
from fmu_builder.parameter_set import ParameterSet, StabilityProof, load, loads
from identification.data_set import DataSet, load_all
from identification.scores import records
from identification.stability import found_certificate, proved

RATE = 6.0
"""Looked for where nobody says: three times the fastest movement of the demo's training data [m/s]."""

_RESOURCE = "resources/parameter_set.json"


@dataclass(frozen=True)
class ProveResult:
    """What was proved of one file.

    Attributes:
        file: The file.
        name: Of the network.
        method: "nodes", "common" or "local_models".
        proof: What is proved.
        excluded: Whether it is shown, too, that there is no common Lyapunov matrix.
        stored: Whether the certificate stands in the file now.
    """

    file: Path
    name: str
    method: str
    proof: StabilityProof
    excluded: bool
    stored: bool

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        proof = self.proof
        return {
            "file": str(self.file),
            "name": self.name,
            "model_hash": proof.model_hash,
            "method": self.method,
            "rate": proof.rate,
            "decay": proof.decay,
            "common_excluded": self.excluded,
            "stored": self.stored,
            "statement": proof.statement,
            "limits": proof.limits,
        }

    def text(self) -> str:
        """Return the result for a person."""
        lines = [f"{self.name}: {self.proof.statement}", self.proof.limits]
        if self.excluded:
            lines.append("Proved as well: there is no common Lyapunov matrix, which would bound no rate.")
        if not self.stored:
            lines.append("The certificate is not stored; --store writes it into the parameter set.")
        return "\n".join(lines)


def prove_file(
    path: Path,
    rate: float | None = None,
    data_files: Sequence[Path] = (),
    *,
    anew: bool = False,
    store: bool = False,
    reporter: Reporter = SILENT,
) -> ProveResult:
    """Prove the stability of a network from the certificate in its file, or from one that is looked for.

    Args:
        path: A parameter set (.json), or an FMU that carries one.
        rate: Of the scheduling variable, its unit per second. A certificate that is stored for less is not
            enough then. By default what is stored counts; where nothing is, `RATE` is looked for, and where
            that is too much the largest rate.
        data_files: Experiments whose FIT stands beside the proof, in place of stored scores.
        anew: Look for a certificate even where one is stored.
        store: Write the certificate into the parameter set.
        reporter: Told how far the search is.

    Raises:
        SettingsError: A rate that is none, or `store` with an FMU.
        ParameterSetError: The parameter set is not valid.
        FmuError: The FMU carries no parameter set, or another one than it computes with.
        DataError: An experiment does not fit the network.
        CertificateError: The stored certificate proves nothing, or none was found.
        OutputError: The file cannot be written.
    """
    if rate is not None and not (math.isfinite(rate) and rate > 0.0):
        raise SettingsError.of(f"--rate {rate}", "is no rate", "Give a positive number")
    fmu = zipfile.is_zipfile(path)
    if fmu and store:
        mend = "Store it in the parameter set, and build the FMU from that"
        raise SettingsError.of("--store", "does not write into FMUs", mend)
    parameter_set = _of_fmu(path) if fmu else load(path)
    scored = parameter_set
    if data_files:
        scored = parameter_set.replaced(scores=_scores(parameter_set, load_all(data_files)))
    stored = parameter_set.certificate
    proof = None if anew else proved(scored)
    kept = proof is not None and (rate is None or proof.rate is None or proof.rate >= rate)
    if not kept:
        reporter.say("looking for a certificate")
        stored = found_certificate(parameter_set, rate or RATE, reporter.say, or_less=rate is None)
        parameter_set = parameter_set.replaced(certificate=stored)
        proof = proved(scored.replaced(certificate=stored))
        if store:
            parameter_set.save(path)
    assert proof is not None and stored is not None  # a certificate was found, or CertificateError raised
    excluded = stored.exclusion is not None
    return ProveResult(path, parameter_set.name, stored.method, proof, excluded, kept or store)


def _of_fmu(path: Path) -> ParameterSet:
    """Return the parameter set in an FMU, which must be the one that it computes with."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            text = archive.read(_RESOURCE).decode("utf-8") if _RESOURCE in names else None
            description = archive.read("modelDescription.xml")
    except (OSError, KeyError, UnicodeDecodeError, zipfile.BadZipFile, RuntimeError) as reason:
        raise FmuError.of(str(path), f"cannot be read ({reason})", "Give an FMU") from reason
    if text is None:
        mend = "Give the FMU of a network built by this program, or a parameter set"
        raise FmuError.of(str(path), f"holds no {_RESOURCE}", mend)
    parameter_set = loads(text, f"{path}, {_RESOURCE}")
    if "resources/slavemodule.txt" not in names:  # a Python FMU computes with the file itself
        _refuse_other_guid(path, parameter_set, description)
    return parameter_set


def _refuse_other_guid(path: Path, parameter_set: ParameterSet, description: bytes) -> None:
    """Refuse an FMU whose GUID, which its binary asks for, is not that of its parameter set."""
    try:
        root = ET.fromstring(description)
    except ET.ParseError as reason:
        raise FmuError.of(str(path), f"has no model description ({reason})", "Give an FMU") from reason
    identifiers = {found for item in root for found in [item.get("modelIdentifier")] if found}
    proofs = (None,) if parameter_set.certificate is None else (None, proved(parameter_set))
    computes = identity(parameter_set)
    known = {
        interface(parameter_set, identifier, naming, proof).guid(computes)
        for identifier in identifiers
        for naming in ("flat", "structured")
        for proof in proofs
    }
    if root.get("guid") not in known:
        what = f"its GUID is not that of {_RESOURCE}: it may compute with other numbers"
        raise FmuError.of(str(path), what, "Build it anew from the parameter set")


def _scores(parameter_set: ParameterSet, experiments: Sequence[DataSet]) -> tuple[dict[str, Any], ...]:
    """Return the score records of the network, run by the kernel, on experiments."""
    units = {one.name: one.unit for one in (*parameter_set.inputs, *parameter_set.outputs)}
    units |= {one.name: one.unit for one in parameter_set.derived_outputs}
    found: list[Problem] = []
    for data in experiments:
        missing = [name for name in parameter_set.input_names if name not in data.names]
        if not set(parameter_set.output_names) & set(data.names):
            missing += parameter_set.output_names
        if missing:
            mend = "Name the columns like the signals of the network"
            found.append(Problem(f"data set {data.name!r}", f"lacks {', '.join(missing)}", mend))
        found += data.scale_problems(parameter_set.sample_time, list(units), list(units.values()))
    if found:
        raise DataError(found)
    scores: list[dict[str, Any]] = []
    for data in experiments:
        outputs = simulate(parameter_set, data.matrix(parameter_set.input_names))
        columns = [k for k, name in enumerate(parameter_set.output_names) if name in data.names]
        compared = [parameter_set.output_names[k] for k in columns]
        labels = {"data_set": data.name}
        scores += records(data.matrix(compared), outputs[:, columns], compared, labels)
    return tuple(scores)

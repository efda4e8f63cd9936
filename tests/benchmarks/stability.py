"""What is proved of networks, and what the proof costs. Run: python -m tests.benchmarks.stability [FILE ...]

Files are parameter sets; without any, the networks that come with the project. One line each: rate, decay,
FIT of the contact force, CPU seconds of search and proof, size of the certificate; scores stand in the file
or in scores.json beside it.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from fmu_builder.errors import CertificateError
from fmu_builder.parameter_set import ParameterSet, load
from identification.stability import found_certificate, verify

RATE, LEAST_RATE = 6.0, 4.0  # m/s: asked for; at least, where the first cannot be had
HAT_SECONDS, TABLE_SECONDS = 1.0, 10.0  # CPU of the proof: "under a second for hats, seconds for node tables"
HAT_NODES = 10
SIGNAL = "F_p"


def shipped() -> list[Path]:
    """Parameter sets of networks in fmus/."""
    folder = Path(__file__).parents[2] / "fmus"
    return [
        path
        for path in sorted(folder.glob("*/parameters.json"))
        if "node_table" in json.loads(path.read_text())
    ]


def fit_of(network: ParameterSet, path: Path) -> str:
    """The lowest FIT of the contact force on test data."""
    beside = path.with_name("scores.json")
    scores: list[dict[str, Any]] = list(network.scores) or (
        json.loads(beside.read_text()) if beside.is_file() else []
    )
    fits = [one["fit"] for one in scores if one["signal"] == SIGNAL and one["split"] == "test"]
    return f"{min(fits):.2f} %" if fits else "not stored"


def one_network(path: Path) -> tuple[str, bool]:
    """The line on one network, and whether the limits are kept."""
    network = load(path)
    begin = time.process_time()
    try:
        certificate = found_certificate(network, RATE, or_less=True)
    except CertificateError as refused:
        return f"{network.name:<28} {refused}  FIT {fit_of(network, path)}", False
    searched = time.process_time() - begin
    content = json.loads(network.replaced(certificate=certificate).canonical_json())
    begin = time.process_time()
    shown = verify.verify(content)
    seconds = time.process_time() - begin
    table = network.node_table
    models = network.local_models if table is None or not table.models else table.models
    radius = np.abs(np.linalg.eigvals(np.array([model.A for model in models]))).max()
    limit = TABLE_SECONDS if len(models) > HAT_NODES else HAT_SECONDS
    kept = (shown.rate is None or shown.rate >= LEAST_RATE) and seconds <= limit
    rate = "any" if shown.rate is None else f"{shown.rate:g}"
    bare = network.replaced(certificate=None)
    size = len(bare.replaced(certificate=certificate).canonical_json()) - len(bare.canonical_json())
    line = (
        f"{network.name:<28} rate {rate:>4}  decay {shown.decay:.3g} of"
        f" {(1.0 - radius) / network.sample_time:.3g} 1/s  FIT {SIGNAL} {fit_of(network, path)}"
        f"  search {searched:.1f} s  proof {seconds:.2f} s, {shown.matrices} matrices, {size / 1000:.1f} kB"
        f"  common P {'excluded' if shown.common_excluded else 'not excluded'}"
    )
    return line, kept


def main(paths: list[Path]) -> int:
    """Print a line per network; 1 when a limit is not kept."""
    if not paths:
        print("no networks: give parameter sets")
        return 1
    failed = 0
    for path in paths:
        line, kept = one_network(path)
        failed |= not kept
        print(f"{'pass' if kept else 'FAIL'}  {line}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main([Path(name) for name in sys.argv[1:]] or shipped()))

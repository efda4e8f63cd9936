"""The long run behind `make fuzz`: PYTHONPATH=tests python -m fuzz.long [--seconds S] [--folder F] [PART ...]

Parts are MODEL-KIND of fuzz.runtime (surrogate-behaviour, ...) and the kinds of fuzz.inputs (archives, ...);
all by default, each with the same share of the time. What the C runs have learned stays in
FOLDER/PART/corpus, where the next run begins. Exit status 1 when something was found; the file that shows it
is named.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from fuzz import inputs, runtime

_FIGURES = re.compile(r"^stat::(\w+):\s*(\d+)", re.MULTILINE)
_COVERAGE = re.compile(r"cov: (\d+) ft: (\d+) corp: (\S+)")
_LINES = 25


DELIVERED = "delivered"
"""The binary as an importer gets it, without sanitizers: most calls in the time."""


def parts() -> list[str]:
    """Return the names of all parts that can run here."""
    ways = (*runtime.kinds(), *([DELIVERED] if shutil.which("gcc") else []))
    of_c = [f"{model}-{way}" for model in runtime.MODELS for way in ways]
    return [*of_c, *inputs.KINDS]


def _said(part: str, text: str, found: str) -> None:
    print(f"{part:<24} {text}" + (f"\n{found}" if found else ""), flush=True)


def _drawn(command: Path, seconds: float, environment: Mapping[str, str]) -> tuple[int, str]:
    """Seeds one after the other, a hundred per process, without libFuzzer."""
    end, first = time.monotonic() + seconds, 1
    while time.monotonic() < end:
        words = [str(command), "--seeds", str(first), "100", "600"]
        result = subprocess.run(words, env=environment, capture_output=True, text=True, errors="replace")
        if result.returncode != 0:
            library = f"FUZZ_LIBRARY={environment['FUZZ_LIBRARY']} " if "FUZZ_LIBRARY" in environment else ""
            reproducer = f"{library}{command} --seeds SEED 1 600, with the last seed above"
            return first, "\n".join([*result.stderr.splitlines()[-_LINES:], f"reproduce: {reproducer}"])
        first += 100
    return first - 1, ""


def run_runtime(part: str, folder: Path, seconds: float) -> bool:
    """Fuzz the C runtime of one FMU in one way; whether nothing was found."""
    model, _, name = part.partition("-")
    kind = runtime.kinds().get(name)
    place = folder / part
    place.mkdir(parents=True, exist_ok=True)
    fmu = runtime.unpacked(model, place)
    if kind is None:
        program = runtime.plain_program(fmu, place / "fuzz_runtime")
        environment = {**os.environ, "FUZZ_LIBRARY": str(runtime.production_binary(fmu))}
    else:
        program, environment = runtime.program(kind, fmu, place / "fuzz_runtime"), dict(os.environ)
    if kind is None or not kind.fuzzer:
        executions, found = _drawn(program, seconds, environment)
        _said(part, f"{executions} executions", found)
        return not found
    corpus = runtime.seed_folder(place / "corpus")
    command = runtime.libfuzzer_command(program, corpus, place, seconds=max(1, int(seconds)))
    result = subprocess.run(command, capture_output=True, text=True, errors="replace")
    figures = dict(_FIGURES.findall(result.stderr))
    covered = _COVERAGE.findall(result.stderr)
    edges, features, size = covered[-1] if covered else ("?", "?", "?")
    executions = figures.get("number_of_executed_units", "?")
    found = "" if result.returncode == 0 else "\n".join(_interesting(result.stderr))
    _said(part, f"{executions} executions, {edges} edges, {features} features, corpus {size}", found)
    return result.returncode == 0


def _interesting(text: str) -> list[str]:
    """The lines that say what was found, and the file that shows it."""
    lines = text.splitlines()
    marks = ("fuzz: ", "runtime error", "ERROR: ", "WARNING: MemorySanitizer", "SUMMARY", "Test unit written")
    first = next((k for k, line in enumerate(lines) if any(mark in line for mark in marks)), 0)
    return [*lines[first : first + _LINES], *(line for line in lines if marks[-1] in line)]


def run_inputs(part: str, folder: Path, seconds: float) -> bool:
    """Give damaged files to the commands; whether nothing was found."""
    first = int(time.time()) % 10**6 * 1000  # other cases every time; a finding names its number
    words = ["--folder", str(folder / part), "--first", str(first), "--seconds", str(seconds)]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "fuzz.inputs", part, *words]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace")
    lines = (result.stdout + result.stderr).splitlines()
    figures = next((line for line in lines if line.startswith(f"{part}: ")), "ended early")
    _said(part, figures.removeprefix(f"{part}: "), "" if result.returncode == 0 else "\n".join(lines))
    return result.returncode == 0


def main(words: Sequence[str] | None = None) -> int:
    """Run the parts one after the other."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART")
    parser.add_argument("--seconds", type=float, default=600.0, help="for all parts together")
    parser.add_argument("--folder", type=Path, default=Path("runs/fuzz"))
    chosen = parser.parse_args(words)
    known = parts()
    wanted = chosen.parts or known
    unknown = sorted(set(wanted) - set(known))
    if unknown:
        parser.error(f"unknown here: {', '.join(unknown)}; known are {', '.join(known)}")
    share = chosen.seconds / len(wanted)
    folder = chosen.folder.resolve()
    print(f"{share:.0f} s for each of {len(wanted)} parts; files in {chosen.folder}", flush=True)
    fine = [(run_inputs if part in inputs.KINDS else run_runtime)(part, folder, share) for part in wanted]
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())

"""Opening anybody's FMU without trusting it."""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from fmpy import platform as fmpy_platform
from fmpy import read_model_description, sharedLibraryExtension

from fmu_builder.check import Severity, inspect_archive, unpack
from fmu_builder.errors import FmuError, Problem


@dataclass(frozen=True)
class OpenFmu:
    """An FMU unpacked into a temporary folder.

    Attributes:
        path: The archive.
        folder: Where it is unpacked; gone when the context ends.
        description: fmpy's reading of modelDescription.xml.
        sha256: Hash of the archive, for provenance.
    """

    path: Path
    folder: Path
    description: Any
    sha256: str

    def variable(self, name: str) -> Any:
        """Return fmpy's record of a variable.

        Raises:
            FmuError: There is none of that name.
        """
        self.require([name])
        return next(item for item in self.description.modelVariables if item.name == name)

    def require(
        self,
        names: Iterable[str],
        causality: str | None = None,
        kind: str | None = None,
        table: str = "signals",
    ) -> None:
        """Check that the FMU has all variables `names`, with `causality` and of the type `kind` if given.

        Args:
            names: What must be there.
            causality: "input", "output", ...
            kind: "Real", "Integer", ...
            table: Where the user wrote the names, for messages.

        Raises:
            FmuError: Names every variable that is missing, of another causality or of another type.
        """
        known = {item.name: item for item in self.description.modelVariables}
        problems = []
        for name in names:
            place = f"{self.path.name}, variable {name!r}"
            if name not in known:
                near = get_close_matches(name, list(known), n=3)
                hint = f"did you mean {', '.join(map(repr, near))}?" if near else _inventory(known)
                problems.append(Problem(place, "the FMU has no such variable", f"Mend {table}: {hint}"))
            elif causality and known[name].causality != causality:
                what = f"is of causality {known[name].causality!r}, not {causality!r}"
                problems.append(Problem(place, what, f"Map a variable of causality {causality!r} in {table}"))
            elif kind and known[name].type != kind:
                what = f"is of type {known[name].type}, not {kind}"
                problems.append(Problem(place, what, f"Map a variable of type {kind} in {table}"))
        if problems:
            raise FmuError(problems)


def _inventory(known: dict[str, Any]) -> str:
    usable = [name for name, item in known.items() if item.causality in ("input", "output")]
    return "its inputs and outputs are " + (", ".join(usable[:20]) or "none")


def same_unit(one: str | None, other: str | None) -> bool:
    """Return whether two units are one, as far as they are known: N.m, N*m and Nm are."""
    written = str.maketrans("", "", ".*· ^")
    return not one or not other or one.translate(written) == other.translate(written)


def _unpack(path: Path, folder: Path) -> None:
    """Unpack an archive after looking at every entry.

    Raises:
        FmuError: The file is missing, unreadable, damaged, or its entries are unsafe.
    """
    harmless = ("archive-duplicate",)  # zip files of many tools have them, and the last one counts here
    found = [item for item in inspect_archive(path) if item.rule not in harmless]
    if not any(item.severity is Severity.ERROR for item in found):
        found = unpack(path, folder)
    problems = [
        Problem(str(path) if item.place == "archive" else f"{path}, {item.place}", item.what, item.mend)
        for item in found
        if item.severity is Severity.ERROR
    ]
    if problems:
        raise FmuError(problems)


def _read_description(path: Path, folder: Path) -> Any:
    """Read modelDescription.xml and check that the FMU can run here as a co-simulation slave."""
    try:
        description = read_model_description(str(folder), validate=True)
    except Exception as reason:
        what = f"modelDescription.xml cannot be used ({reason})"
        raise FmuError.of(str(path), what, "Ask its author for a valid FMI 2.0 export") from reason
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        what = f"is FMI {description.fmiVersion}, " + (
            "co-simulation" if description.coSimulation else "without co-simulation"
        )
        raise FmuError.of(str(path), what, "Export it as FMI 2.0 for co-simulation")
    name = description.coSimulation.modelIdentifier + sharedLibraryExtension
    if not (folder / "binaries" / fmpy_platform / name).is_file():
        have = ", ".join(sorted(item.name for item in (folder / "binaries").glob("*"))) or "none"
        what = f"has no binary for {fmpy_platform} (it has: {have})"
        raise FmuError.of(str(path), what, "Export it for this platform, or compile its sources with fmpy")
    return description


_unpacked: set[Path] = set()
"""Folders that stand; what Ctrl-C leaves of them while they are deleted goes when the program ends."""


@atexit.register
def _delete_unpacked() -> None:
    for folder in _unpacked:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="llmn-fmu-"))
    _unpacked.add(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _unpacked.discard(folder)


@contextmanager
def open_fmu(path: Path) -> Iterator[OpenFmu]:
    """Unpack an FMU into a temporary folder for as long as the block lasts.

    Args:
        path: An FMI 2.0 co-simulation FMU with a binary for this machine.

    Yields:
        The unpacked FMU.

    Raises:
        FmuError: The file is missing, damaged, unsafe to unpack, not FMI 2.0 co-simulation, or has no binary
            that runs here.
    """
    with _temporary_folder() as folder:
        _unpack(path, folder)
        description = _read_description(path, folder)
        yield OpenFmu(path, folder, description, hashlib.sha256(path.read_bytes()).hexdigest())

"""What the readers of all formats return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

MACHINES = ("x86", "x86_64", "aarch64")


@dataclass(frozen=True)
class Binary:
    """A shared library for one processor.

    Attributes:
        format: "ELF", "PE" or "Mach-O".
        machine: One of `MACHINES`, or a number in words for another.
        exported: Names others can link with.
        needed: Names it takes from others and cannot do without (of PE libraries: empty).
        libraries: Names of the libraries it asks the loader for.
        versions: Symbol version ("GLIBC_2.29") -> names that need it.
        remarks: Further facts by name: "executable stack", "install name", "unsigned".
    """

    format: str
    machine: str
    exported: frozenset[str]
    needed: frozenset[str] = frozenset()
    libraries: tuple[str, ...] = ()
    versions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)

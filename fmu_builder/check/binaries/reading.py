"""One door for all formats."""

from __future__ import annotations

from fmu_builder.check.binaries import elf, mach_o, pe
from fmu_builder.check.binaries.binary import Binary
from fmu_builder.check.binaries.bytes_view import BinaryError

__all__ = ["Binary", "BinaryError", "read_binary"]


def read_binary(content: bytes) -> list[Binary]:
    """Return what a shared library says about itself, one entry per processor it holds code for.

    Raises:
        BinaryError: It is no ELF, PE or Mach-O library, or its tables are damaged.
    """
    for reader in (elf.read, pe.read, mach_o.read):
        found = reader(content)
        if found:
            return found
    raise BinaryError("is neither an ELF, nor a PE, nor a Mach-O library")

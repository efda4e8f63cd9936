"""Shared libraries read from their bytes: what they are, what they offer and what they need to load."""

from fmu_builder.check.binaries.elf import object_symbols
from fmu_builder.check.binaries.reading import Binary, BinaryError, read_binary

__all__ = ["Binary", "BinaryError", "object_symbols", "read_binary"]

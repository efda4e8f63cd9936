"""What FMUs say, kept per instance.

An FMU calls its logger with printf arguments, which Python cannot read; fmpy brings a small library that
formats them first. That library remembers one logger for the whole process, and fmpy itself uses it. A copy
keeps the two apart, and the one logger registered with the copy passes each message on to its instance.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmpy import calloc, free
from fmpy import logging as fmpy_logging
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

STATUS_NAMES = ("OK", "warning", "discard", "error", "fatal", "pending")
_listeners: dict[int, Callable[[str], None]] = {}


def _receive(environment: int | None, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
    listener = _listeners.get(environment or 0)
    if listener is not None:
        kind = STATUS_NAMES[status] if 0 <= status < len(STATUS_NAMES) else str(status)
        listener(f"{kind}: {(message or b'').decode('utf-8', errors='replace')}")


_LOGGER = fmi2CallbackLoggerTYPE(_receive)
_ALLOCATE = fmi2CallbackAllocateMemoryTYPE(calloc)
_FREE = fmi2CallbackFreeMemoryTYPE(free)


@functools.cache
def _formatter() -> Any:
    """Return the function that puts the formatting library between an FMU and the logger."""
    original = Path(fmpy_logging.logging._name)
    folder = Path(tempfile.mkdtemp(prefix="llmn-log-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    copy = shutil.copy(original, folder / original.name)
    function = ctypes.CDLL(str(copy)).addLoggerProxy
    function.argtypes, function.restype = [ctypes.c_void_p], None
    return function


def callbacks_for(instance: object, listener: Callable[[str], None]) -> fmi2CallbackFunctions:
    """Return FMI callbacks whose messages go to `listener` until `forget` is called with `instance`."""
    callbacks = fmi2CallbackFunctions()
    callbacks.logger, callbacks.allocateMemory, callbacks.freeMemory = _LOGGER, _ALLOCATE, _FREE
    callbacks.componentEnvironment = id(instance)
    _listeners[id(instance)] = listener
    _formatter()(ctypes.byref(callbacks))
    return callbacks


def forget(instance: object) -> None:
    """Stop listening to an instance."""
    _listeners.pop(id(instance), None)

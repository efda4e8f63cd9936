"""Compiled libraries kept in the user's cache folder, by what they were made of."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

MOST, LEFT = 600, 400
"""More files than the first number are not kept; of these, so many that were used last stay."""

_DIGEST = hashlib.sha256().digest_size


def key_of(parts: Iterable[bytes]) -> str:
    """Return the name for what is made of these parts: their SHA-256 with their lengths (hex)."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()


def kept(folder: Path, key: str) -> bytes | None:
    """Return the content kept under a key; None where there is none, or it is not what was put there."""
    path = folder / key
    try:
        whole = path.read_bytes()
        digest, content = whole[:_DIGEST], whole[_DIGEST:]
    except OSError:
        return None
    if digest != hashlib.sha256(key.encode() + content).digest():
        return None
    with contextlib.suppress(OSError):  # only says when it was used last
        os.utime(path)
    return content


def keep(folder: Path, key: str, content: bytes) -> None:
    """Keep content under a key if the folder can be written; nothing half-written, any thread may call."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder, prefix=".")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(key.encode() + content).digest() + content)
            Path(name).replace(folder / key)
        finally:
            Path(name).unlink(missing_ok=True)
        _tidy(folder)


def _tidy(folder: Path) -> None:
    files = list(folder.iterdir())
    if len(files) > MOST:
        times = {}
        for path in files:
            with contextlib.suppress(OSError):  # another process tidies, too
                times[path] = path.stat().st_mtime
        for path in sorted(times, key=lambda one: times[one], reverse=True)[LEFT:]:
            path.unlink(missing_ok=True)

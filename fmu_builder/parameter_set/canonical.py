"""Canonical JSON: one text per content, and numbers that come back with every bit."""

from __future__ import annotations

import json
from typing import Any


def canonical_json(content: Any) -> str:
    """Return `content` (dicts, lists, tuples, strings, numbers, booleans, None) as JSON, ending in a newline.

    Keys are sorted, floats are printed by `repr` (the shortest digits that read back to the same bits), and a
    list that holds no list or dict stands on one line: a matrix reads like one, a changed number is one line.

    Raises:
        ValueError: A number is not finite.
    """
    return _text(content, 0) + "\n"


def compact_json(content: Any) -> str:
    """Return `content` as `canonical_json` does, in one line without spaces: the same content in less room.

    Raises:
        ValueError: A number is not finite.
    """
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":"))
    return text + "\n"


def _text(item: Any, depth: int) -> str:
    if isinstance(item, dict) and item:
        lines = [f"{_scalar(key)}: {_text(item[key], depth + 1)}" for key in sorted(item)]
        return _block("{", lines, "}", depth)
    if isinstance(item, list | tuple) and any(isinstance(part, dict | list | tuple) for part in item):
        return _block("[", [_text(part, depth + 1) for part in item], "]", depth)
    return _scalar(item)


def _block(opening: str, lines: list[str], closing: str, depth: int) -> str:
    inner = ",\n".join(" " * (depth + 1) + line for line in lines)
    return f"{opening}\n{inner}\n{' ' * depth}{closing}"


def _scalar(item: Any) -> str:
    return json.dumps(item, ensure_ascii=False, allow_nan=False)

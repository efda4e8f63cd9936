"""Descriptions (XML) and parameter sets (JSON) damaged at random, by what they are made of."""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Callable
from typing import Any

_VALUES = (
    *(
        "",
        "-1",
        "0",
        "1",
        "99999999999999999999",
        "9" * 5000,
        "1e999",
        "-1e-400",
        "NaN",
        "INF",
        "-INF",
        "true",
    ),
    *(
        "0x10",
        "1_000",
        " 7 ",
        "\u0663",
        "input",
        "a b",
        "\u00e9",
        "'",
        "[",
        "{}",
        "../../evil",
        "/etc/passwd",
    ),
    *("x" * 70000, "&#10;&#13;&#9;", "&#x1b;[2J", "a&#x202e;b", "%s%n%x", "{0.__class__}", "structured"),
)
_HEADS = (
    '<?xml version="1.0" encoding="UTF-16"?>', '<?xml version="1.0" encoding="no-such"?>',
    '<?xml version="1.1"?>', '<?xml version="1.0" encoding="latin-1"?>', "", "\ufeff", "<!-- -- -->",
    '<!DOCTYPE f SYSTEM "file:///etc/passwd">', '<!DOCTYPE f [<!ENTITY % x SYSTEM "x.dtd"> %x;]>',
    '<!DOCTYPE f [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
    '<?xml-stylesheet href="x"?>',
)  # fmt: skip


def _span(pattern: str, text: str, draw: random.Random) -> tuple[int, int]:
    """One place of a pattern: its first group, or all of it; the end of the text when there is none."""
    found = list(re.finditer(pattern, text, re.DOTALL))
    if not found:
        return len(text), len(text)
    chosen = draw.choice(found)
    return chosen.span(1 if chosen.re.groups else 0)


def _put(text: str, span: tuple[int, int], new: str) -> str:
    return text[: span[0]] + new + text[span[1] :]


def _value(text: str, draw: random.Random) -> str:
    return _put(text, _span(r'="([^"]*)"', text, draw), draw.choice(_VALUES))


def _attribute_lost(text: str, draw: random.Random) -> str:
    return _put(text, _span(r' \w+="[^"]*"', text, draw), "")


def _attribute_moved(text: str, draw: random.Random) -> str:
    begin, end = _span(r' \w+="[^"]*"', text, draw)
    other = _span(r"<\w+()", text, draw)
    return _put(text, other, text[begin:end])


def _element(text: str, draw: random.Random) -> str:
    """An element twice, or in the place of another."""
    begin, end = _span(r"<(\w+)[^<>]*/>", text, draw)
    begin = max(text.rfind("<", 0, begin + 1), 0)
    return _put(
        text, _span(r"<\w+[^<>]*/>", text, draw) if draw.random() < 0.5 else (end, end), text[begin:end]
    )


def _tag(text: str, draw: random.Random) -> str:
    return _put(
        text, _span(r"</?(\w+)", text, draw), draw.choice(("Real", "x:y", "Unknown", "fmi2", "Outputs"))
    )


def _line_lost(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    if lines:
        del lines[draw.randrange(len(lines))]
    return "".join(lines)


def _nested(text: str, draw: random.Random) -> str:
    depth = draw.choice((10, 300, 5000, 100000))
    at = _span(r"<ModelVariables>()", text, draw)
    return _put(text, at, "<a>" * depth + "</a>" * (depth - draw.randrange(2)))


def _many(text: str, draw: random.Random) -> str:
    begin, end = _span(r"<ScalarVariable.*?</ScalarVariable>", text, draw)
    return _put(text, (end, end), text[begin:end] * draw.choice((2, 300)))


def _head(text: str, draw: random.Random) -> str:
    return draw.choice(_HEADS) + text[text.find("<fmi") if draw.random() < 0.8 else 0 :]


def _entity(text: str, draw: random.Random) -> str:
    laughs = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 12))
    head = f'<!DOCTYPE f [<!ENTITY l0 "ha"><!ENTITY s SYSTEM "file:///etc/passwd">{laughs}]>'
    begin = max(text.find("<fmi"), 0)
    return head + _value_of(text[begin:], draw.choice(("&l11;", "&s;", "&unknown;")), draw)


def _value_of(text: str, value: str, draw: random.Random) -> str:
    return _put(text, _span(r'="([^"]*)"', text, draw), value)


def _letter(text: str, draw: random.Random) -> str:
    at = draw.randrange(len(text) + 1)
    return text[:at] + draw.choice("<>&\"'/\x00\x1b\ud800]-!") + text[at + 1 :]


XML: tuple[Callable[[str, random.Random], str], ...] = (
    _value, _value, _value, _attribute_lost, _attribute_moved, _element, _tag, _line_lost, _nested, _many,
    _head, _entity, _letter,
)  # fmt: skip


def damaged_xml(text: str, draw: random.Random) -> bytes:
    """Return a description with one to four changes, as bytes that need not be UTF-8."""
    for _ in range(draw.randint(1, 4)):
        text = draw.choice(XML)(text, draw)
    encoding = draw.choice(("utf-8",) * 9 + ("utf-16", "latin-1"))
    content = bytearray(text.encode(encoding, errors="surrogatepass" if encoding != "latin-1" else "replace"))
    return bytes(_bytes_changed(content, draw) if draw.random() < 0.1 else content)


def _bytes_changed(content: bytearray, draw: random.Random) -> bytearray:
    for _ in range(draw.randint(1, 5)):
        if content:
            content[draw.randrange(len(content))] = draw.choice((0, 0x80, 0xC0, 0xFF, draw.getrandbits(8)))
    return content


# Parameter sets. What json.dumps would not write stands for itself.

_ITEMS: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 10**30, -(2**63), 0.0, -0.0, 1e308, -1e308, 5e-324, 1e-300, 1e300, 0.1,
    "", "x", "eta", "\x00", "\ud800", "../../evil", "a b", "1", "nan", "x" * 70000, "\u202e", "*/ int x; /*",
    '"); x("', "\\", "\n", [], {}, [[]], [0.0], [[0.0]], [1.0, 2.0], {"a": 1}, [None], [["x"]], [True],
)  # fmt: skip
_WORDS = (
    "NaN",
    "Infinity",
    "-Infinity",
    "1e999",
    "-1e999",
    "0" * 9,
    "9" * 5000,
    "1.",
    ".5",
    "+1",
    "0x1",
    "nul",
)


def _places_of(item: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """Every (container, key) inside; numbers of matrices would crowd out the rest, so few of them."""
    keys = list(item) if isinstance(item, dict) else range(len(item))
    for key in keys:
        found.append((item, key))
        if isinstance(item[key], dict | list):
            _places_of(item[key], found)
    return found


def _place(content: Any, draw: random.Random) -> tuple[Any, Any] | None:
    places = _places_of(content, [])
    few = [place for place in places if isinstance(place[0], dict)]
    chosen = few if few and draw.random() < 0.6 else places
    return draw.choice(chosen) if chosen else None


def _changed(content: Any, draw: random.Random) -> None:
    place = _place(content, draw)
    if place is None:
        return
    container, key = place
    how = draw.random()
    if how < 0.45:
        container[key] = copy.deepcopy(draw.choice(_ITEMS))
    elif how < 0.6:
        del container[key]
    elif how < 0.75:
        other = _place(content, draw)
        if other is not None and other[0] is not container:
            container[key] = copy.deepcopy(other[0][other[1]])
    elif how < 0.85 and isinstance(container[key], float | int):
        container[key] = container[key] * draw.choice((-1, 1e-200, 1e150, 1e300, 1.0000001))
    elif how < 0.93 and isinstance(container[key], list):
        container[key] = container[key] * draw.choice((0, 2, 50)) + container[key][:1]
    elif isinstance(container, dict):
        container[draw.choice(("self", "name", "__class__", "", "model_config", "\ud800", "a" * 300))] = 1


def _deep(text: str, draw: random.Random) -> str:
    depth = draw.choice((50, 400, 900, 3000, 100000))
    opening, closing = draw.choice((("[", "]"), ('{"a":', "}")))
    deep = opening * depth + "1" + closing * depth
    at = text.find('"provenance":')
    return text[: at + 13] + deep + text[text.find(",", at) :] if at >= 0 and draw.random() < 0.7 else deep


def _word(text: str, draw: random.Random) -> str:
    return _put(text, _span(r"[-\d.][-+\d.eE]+", text, draw), draw.choice(_WORDS))


def _twice(text: str, draw: random.Random) -> str:
    begin, end = _span(r'"\w+": [^,\[{}\]]+,', text, draw)
    return _put(text, (end, end), text[begin:end])


def _byte(text: str, draw: random.Random) -> str:
    at = draw.randrange(len(text) + 1)
    return text[:at] + draw.choice('{}[]",:\\\x00\x1b\ufeff0e') + text[at + draw.randrange(2) :]


_TEXTS = (_deep, _word, _word, _twice, _byte)


def damaged_json(content: dict[str, Any], draw: random.Random) -> bytes:
    """Return a parameter set with some changes of its content, of its text, or of both."""
    content = copy.deepcopy(content)
    how = draw.random()
    for _ in range(draw.randint(1, 3) if how < 0.75 else 0):
        _changed(content, draw)
    text = json.dumps(content, ensure_ascii=draw.random() < 0.5)
    for _ in range(draw.randint(1, 2) if how > 0.65 else 0):
        text = draw.choice(_TEXTS)(text, draw)
    encoding = draw.choice(("utf-8",) * 9 + ("utf-16", "utf-8-sig"))
    result = bytearray(text.encode(encoding, errors="surrogatepass"))
    return bytes(_bytes_changed(result, draw) if draw.random() < 0.1 else result)

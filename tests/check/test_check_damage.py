"""Descriptions damaged at random: findings only, whatever stands in the file."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from check.defects import STATIC, entries_of, write
from fmu_builder.check import Options, check_fmu

VALUES = (
    "",
    "-1",
    "0",
    "99999999999999999999",
    "1e999",
    "NaN",
    "-INF",
    "true",
    "input",
    "a b",
    "\u00e9",
    "'",
    "[",
    "{}",
)
ROUNDS = 200


def _changed_value(text: str, draw: random.Random) -> str:
    """Another value for one attribute."""
    place = draw.choice(list(re.finditer(r'="([^"]*)"', text)))
    return text[: place.start(1)] + draw.choice(VALUES) + text[place.end(1) :]


def _lost_attribute(text: str, draw: random.Random) -> str:
    place = draw.choice(list(re.finditer(r' \w+="[^"]*"', text)))
    return text[: place.start()] + text[place.end() :]


def _moved_line(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    line = lines.pop(draw.randrange(len(lines)))
    lines.insert(draw.randrange(len(lines)), line if draw.random() < 0.7 else line + line)
    return "".join(lines)


def _lost_line(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    del lines[draw.randrange(len(lines))]
    return "".join(lines)


def _noise(text: str, draw: random.Random) -> str:
    at = draw.randrange(len(text))
    return text[:at] + draw.choice("<>&\"'/\x00\x1b\ud800]") + text[at + 1 :]


CHANGES = (_changed_value, _changed_value, _lost_attribute, _moved_line, _lost_line, _noise)


@pytest.mark.parametrize("seed", range(4))
def test_random_damage_gives_messages_only(seed: int, right_fmu: Path, tmp_path: Path) -> None:
    draw = random.Random(seed)
    entries = {name: c for name, c in entries_of(right_fmu).items() if not name.startswith("binaries/")}
    text = entries["modelDescription.xml"].decode()
    fmu = tmp_path / "lti_test.fmu"
    found = 0
    for _ in range(ROUNDS):
        damaged = text
        for _ in range(draw.randint(1, 4)):
            damaged = draw.choice(CHANGES)(damaged, draw)
        content = damaged.encode("utf-8", errors="surrogatepass")
        write(fmu, {**entries, "modelDescription.xml": content}.items())
        report = check_fmu(fmu, STATIC)
        assert all(item.what and item.mend and item.place for item in report.findings)
        found += bool(report.findings)
    assert found > 0.8 * ROUNDS
    assert list(tmp_path.iterdir()) == [fmu]


def test_damage_reaches_no_further_when_the_binary_runs(right_fmu: Path, tmp_path: Path) -> None:
    """The binary is right, the description is not: value references and types that do not fit."""
    draw = random.Random(99)
    entries = entries_of(right_fmu)
    text = entries["modelDescription.xml"].decode()
    fmu = tmp_path / "lti_test.fmu"
    options = Options(sources=False, experiments=("state", "derivatives", "model exchange"))
    for _ in range(12):
        damaged = text
        for _ in range(6):
            damaged = draw.choice((_changed_value, _lost_attribute))(damaged, draw)
        write(fmu, {**entries, "modelDescription.xml": damaged.encode()}.items())
        report = check_fmu(fmu, options)
        unfinished = [item for item in report.findings if item.rule == "experiment"]
        assert not unfinished, report.text()
    assert list(tmp_path.iterdir()) == [fmu]


def test_entities_are_not_expanded(right_fmu: Path, tmp_path: Path) -> None:
    """A billion laughs, and a file of this machine as an entity."""
    entries = entries_of(right_fmu)
    text = entries["modelDescription.xml"].decode()
    laughs = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 12))
    secret = tmp_path / "secret.txt"
    secret.write_text("do not tell")
    doctype = f'<!DOCTYPE fmi [<!ENTITY l0 "ha"><!ENTITY s SYSTEM "{secret.as_uri()}">{laughs}]>'
    for entity in ("&l11;", "&s;"):
        changed = text.replace("<fmiModelDescription ", doctype + "<fmiModelDescription ").replace(
            'modelName="LTI test model"', f'modelName="{entity}"'
        )
        fmu = write(tmp_path / "a.fmu", {**entries, "modelDescription.xml": changed.encode()}.items())
        report = check_fmu(fmu, STATIC)
        assert not report.passed
        assert "do not tell" not in report.text() and "haha" not in report.text()

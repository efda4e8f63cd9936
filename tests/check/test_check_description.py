"""Defects planted in the description, one per FMU; every one is found, and nothing on the FMU without."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmpy import validation

from check.defects import STATIC, finding, replaced, rules, with_description
from fmu_builder.check import Severity, check_fmu, whole
from fmu_builder.check.description import DESCRIPTION
from fmu_builder.check.static import names

Change = Callable[[str], str]


def initial_unknowns(change: Callable[[list[str]], list[str]]) -> Change:
    """Change the list of entries of InitialUnknowns."""

    def apply(text: str) -> str:
        head, body, tail = re.split(
            r"(?<=<InitialUnknowns>)(.*?)(?=</InitialUnknowns>)", text, flags=re.DOTALL
        )
        return head + "".join(change(re.findall(r"<Unknown [^>]*/>", body))) + tail

    return apply


def indices_from_zero(text: str) -> str:
    head, structure = text.split("<ModelStructure>")
    return (
        head + "<ModelStructure>" + re.sub(r'index="(\d+)"', lambda m: f'index="{int(m[1]) - 1}"', structure)
    )


# name of the defect -> (rule that must find it, change)
DEFECTS: dict[str, tuple[str, Change]] = {
    "two inputs with one value reference": (
        "input-value-reference", replaced('name="load" valueReference="1"', 'name="load" valueReference="0"'),
    ),
    "modelIdentifier is no C identifier": (
        "model-identifier", replaced('modelIdentifier="lti_test"', 'modelIdentifier="lti-test"', 2),
    ),
    "date with an offset instead of Z": ("date", replaced("00:00:00Z", "00:00:00+00:00")),
    "date that is none": ("date", replaced("2000-01-01T", "2000-13-01T")),
    "InitialUnknowns not in order": ("initial-unknowns-order", initial_unknowns(lambda items: items[::-1])),
    "InitialUnknowns missing": ("initial-unknowns-missing", initial_unknowns(lambda items: items[1:])),
    "serialize without get and set": (
        "serialize-without-state", replaced('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"', 2),
    ),
    "start outside the limits": ("start-limits", replaced('start="1.25"', 'start="3.25"')),
    "start is no number": ("start-value", replaced('start="1.25"', 'start="INF"')),
    "output not in Outputs": (
        "outputs-missing",
        lambda text: re.sub(r"(<Outputs>\s*)<Unknown[^>]*/>", r"\1", text, count=1),
    ),
    "positions counted from 0": ("structure-zero-based", indices_from_zero),
    "start on calculated": ("start-calculated", replaced('nominal="2.0"', 'nominal="2.0" start="0.5"')),
    "input without start": ("start-missing", replaced(' start="-0.75"', "")),
    "undefined unit": ("unit-undefined", replaced('<Unit name="N">', '<Unit name="Newton">')),
    "duplicate name": ("duplicate-name", replaced('name="scaled"', 'name="x_1"')),
    "continuous parameter": (
        "causality", replaced('causality="parameter" variability="fixed" initial="exact">\n      <Real',
                              'causality="parameter" variability="continuous" initial="exact">\n      <Real'),
    ),
    "dangling dependency": (
        "dependency", replaced('index="5" dependencies="2 3 8"', 'index="5" dependencies="99"'),
    ),
    "dependency that is none": (
        "dependency-known", replaced('index="5" dependencies="2 3 8"', 'index="5" dependencies="4"'),
    ),
    "Boolean continuous": (
        "variability",
        replaced('causality="output" variability="discrete"', 'causality="output" variability="continuous"'),
    ),
    "derivative of nothing": ("derivative", replaced('derivative="3"', 'derivative="30"')),
    "min above max": ("limits", replaced('min="0.5" max="4.0"', 'min="4.5" max="4.0"')),
    "start is no item": ("start-limits", replaced('max="2" start="1"', 'max="9" start="7"')),
    "undefined type": ("type-undefined", replaced('declaredType="preset_items"', 'declaredType="presets"')),
    "source file that is not there": (
        "source-file", replaced('<File name="all.c"', '<File name="main.c"', 2),
    ),
    "step of zero": ("default-experiment", replaced('stepSize="0.001"', 'stepSize="0"')),
    "DOCTYPE": ("xml-doctype", replaced("<fmiModelDescription ", "<!DOCTYPE fmi>\n<fmiModelDescription ")),
    "FMI 3": ("fmi-version", replaced('fmiVersion="2.0"', 'fmiVersion="3.0"')),
    "cut short": ("xml", lambda text: text[: len(text) // 2]),
    "attribute the schema does not know": ("schema", replaced('guid="', 'giud="" guid="')),
    "name with a dot": ("name-twin-builder", replaced('name="drive"', 'name="wire.drive"')),
    "name of 56 letters": ("name-simulink", replaced('name="drive"', f'name="{"d" * 56}"')),
    "reserved word": ("name-modelica", replaced('name="drive"', 'name="der"')),
    "name with a line feed": ("variable-name", replaced('name="drive"', 'name="dri&#10;ve"')),
    "name against its convention": (
        "variable-name",
        lambda text: text.replace('"flat"', '"structured"').replace('name="drive"', 'name="a..b"'),
    ),
}  # fmt: skip


def test_nothing_is_found_on_the_right_fmu(right_fmu: Path) -> None:
    report = check_fmu(right_fmu, STATIC)
    assert report.findings == (), report.text()
    assert {"archive", "description"} <= set(report.checked)


@pytest.mark.parametrize("defect", DEFECTS)
def test_planted_defect_is_found(defect: str, right_fmu: Path, tmp_path: Path) -> None:
    rule, change = DEFECTS[defect]
    found = finding(with_description(right_fmu, tmp_path / "lti_test.fmu", change), rule)
    assert found.place and found.what and found.mend and "FMI 2.0.4" in found.paragraph


def test_all_findings_come_at_once(right_fmu: Path, tmp_path: Path) -> None:
    def change(text: str) -> str:
        for name in ("start outside the limits", "input without start", "date that is none", "reserved word"):
            text = DEFECTS[name][1](text)
        return text

    report = check_fmu(with_description(right_fmu, tmp_path / "lti_test.fmu", change), STATIC)
    assert {"start-limits", "start-missing", "date", "name-modelica"} <= rules(report)
    severities = [item.severity for item in report.findings]
    assert severities == sorted(severities, key=list(Severity).index)
    assert not report.passed


def test_a_finding_names_the_line(right_fmu: Path, tmp_path: Path) -> None:
    _, change = DEFECTS["start outside the limits"]
    fmu = with_description(right_fmu, tmp_path / "lti_test.fmu", change)
    found = finding(fmu, "start-limits")
    line = re.search(rf"{DESCRIPTION}, line (\d+), variable 'drive'", found.place)
    assert line is not None
    with zipfile.ZipFile(fmu) as archive:
        lines = archive.read(DESCRIPTION).decode().splitlines()
    assert 'name="drive"' in lines[int(line[1]) - 1]


def test_what_fmpy_alone_finds_is_passed_on(right_fmu: Path, tmp_path: Path, monkeypatch) -> None:
    fmu = with_description(right_fmu, tmp_path / "lti_test.fmu", DEFECTS["undefined unit"][1])
    monkeypatch.setattr(whole, "unit_findings", lambda _description: ())
    found = finding(fmu, "fmpy")
    assert "'N'" in found.what or '"N"' in found.what


def test_what_is_said_already_is_not_said_again(right_fmu: Path, tmp_path: Path) -> None:
    for name in ("undefined unit", "duplicate name", "Boolean continuous", "InitialUnknowns missing"):
        fmu = with_description(right_fmu, tmp_path / "lti_test.fmu", DEFECTS[name][1])
        assert "fmpy" not in rules(check_fmu(fmu, STATIC))


@pytest.mark.parametrize(
    ("name", "is_legal"),
    [
        ("a", True), ("a.b[1].c_2", True), ("a[1,2]", True), ("der(a.b)", True), ("der(a,2)", True),
        ("'a b'.c", True), (r"'a\'b'", True), ("_x", True),
        ("1a", False), ("a..b", False), ("a[x]", False), ("a[1", False), ("der(a", False), ("a b", False),
        ("a.der(b)", False), ("''", False), ("a[1][2]", False), ("\u00e4", False), ("", False),
    ],
)  # fmt: skip
def test_structured_names_are_those_fmpys_grammar_takes(name: str, is_legal: bool) -> None:
    variable = SimpleNamespace(name=name, sourceline=1)
    model = SimpleNamespace(variableNamingConvention="structured", modelVariables=[variable])
    assert (validation._validate_variable_names(model) == []) is is_legal
    assert (names._STRUCTURED.fullmatch(name) is not None) is is_legal

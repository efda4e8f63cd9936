"""Sources of FMUs: compiled by themselves, and several in one image."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from check.defects import entries_of, finding, rules, write
from fmu_builder.check import Options, check_fmu, check_image

COMPILED = Options(behaviour=False)
STRANGER = b"""
#include "fmi2Functions.h"
#define NAME(function) fmi2FullName(function)
const char *fmi2GetVersion(void) { return "2.0"; }
static const char *unused = "the header's own prefix rule is at work";
"""


def with_source(fmu: Path, target: Path, file: str, right: bytes, wrong: bytes) -> Path:
    entries = entries_of(fmu)
    assert entries[f"sources/{file}"].count(right) == 1
    changed = entries[f"sources/{file}"].replace(right, wrong)
    return write(target, {**entries, f"sources/{file}": changed}.items())


def renamed(fmu: Path, target: Path, identifier: str) -> Path:
    """The same FMU under another modelIdentifier."""
    entries = entries_of(fmu)
    text = entries["modelDescription.xml"].replace(
        b'modelIdentifier="lti_test"', f'modelIdentifier="{identifier}"'.encode()
    )
    assert text != entries["modelDescription.xml"]
    return write(target, {**entries, "modelDescription.xml": text}.items())


def test_nothing_is_found_on_the_right_fmu(right_fmu: Path) -> None:
    report = check_fmu(right_fmu, COMPILED)
    assert report.findings == (), report.text()
    assert "sources" in report.checked


DEFECTS = {
    "unprefixed symbol": (
        "unprefixed-symbol", "lti_model.c", b"static double lti_forcing(", b"double lti_forcing(",
    ),
    "prefix ignored": (
        "source-function", "functions.c",
        b"#define fmi2FullName(name) PASTE_EXPANDED(FMI2_FUNCTION_PREFIX, name)",
        b"#define fmi2FullName(name) name",
    ),
    "does not compile": (
        "source-compile", "lti_model.c", b"#define SAMPLE_TIME 0.001", b"#define SAMPLE_TIME ;",
    ),
    "header that is not there": (
        "source-compile", "lti_model.c", b"#define SAMPLE_TIME 0.001",
        b'#include "cvode.h"\n#define SAMPLE_TIME 1',
    ),
}  # fmt: skip


@pytest.mark.parametrize("defect", DEFECTS)
def test_planted_defect_is_found(defect: str, right_fmu: Path, tmp_path: Path) -> None:
    rule, *change = DEFECTS[defect]
    found = finding(with_source(right_fmu, tmp_path / "lti_test.fmu", *change), rule, COMPILED)
    assert "sources" in found.place
    assert str(tmp_path) not in found.what


def test_the_prefix_rule_of_the_standards_header_is_honoured(right_fmu: Path, tmp_path: Path) -> None:
    """Sources that leave the prefix to fmi2Functions.h get it, whatever fmpy's copy does."""
    entries = entries_of(right_fmu)
    entries["sources/all.c"] = STRANGER
    found = finding(write(tmp_path / "lti_test.fmu", entries.items()), "source-function", COMPILED)
    missing = set(re.findall(r"lti_test_fmi2\w+", found.what))
    assert missing and "lti_test_fmi2GetVersion" not in missing
    assert "unprefixed-symbol" not in rules(check_fmu(tmp_path / "lti_test.fmu", COMPILED))


def test_two_fmus_link_into_one_image(right_fmu: Path, tmp_path: Path) -> None:
    other = renamed(right_fmu, tmp_path / "other.fmu", "other_test")
    report = check_image([right_fmu, other], 60.0)
    assert report.findings == (), report.text()
    assert report.checked == ("one image",)
    assert report.fmu == "lti_test.fmu + other.fmu"


def test_a_name_in_two_fmus_is_found(right_fmu: Path, tmp_path: Path) -> None:
    change = DEFECTS["unprefixed symbol"][1:]
    one = with_source(right_fmu, tmp_path / "one.fmu", *change)
    other = renamed(one, tmp_path / "other.fmu", "other_test")
    (found,) = check_image([one, other], 60.0).findings
    assert found.rule == "image" and "lti_forcing" in found.what


def test_two_fmus_of_one_identifier_clash(right_fmu: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(right_fmu.read_bytes())
    (found,) = check_image([right_fmu, copy], 60.0).findings
    assert "lti_test_fmi2" in found.what


def test_sources_outside_the_folder_are_not_compiled(right_fmu: Path, tmp_path: Path) -> None:
    entries = entries_of(right_fmu)
    text = entries["modelDescription.xml"].replace(b'<File name="all.c"', b'<File name="../../all.c"')
    fmu = write(tmp_path / "lti_test.fmu", {**entries, "modelDescription.xml": text}.items())
    report = check_fmu(fmu, COMPILED)
    assert rules(report) == {"source-file"}

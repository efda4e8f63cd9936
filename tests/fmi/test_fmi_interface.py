"""What an interface refuses, and what stands in the description."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest

from fmi import lti
from fmi.conftest import GUID
from fmu_builder.errors import BuildError
from fmu_builder.fmi2 import UNITS, Interface, Variable, model_description, variables_header

OUTPUT = Variable("y", causality="output", unit="m")


def _interface(*variables: Variable, **keywords: object) -> Interface:
    own = {"states": (), "event_indicators": 0, **keywords}
    return replace(lti.INTERFACE, variables=variables or (OUTPUT,), **own)


@pytest.mark.parametrize(
    ("variable", "words"),
    [
        (Variable("1x"), "is not a C identifier"),
        (Variable("a.b"), "is not a C identifier"),
        (Variable("a" * 56), "has 56 characters"),
        (Variable("v", type="Text"), "unknown type 'Text'"),
        (Variable("v", causality="inout"), "unknown causality 'inout'"),
        (Variable("v", causality="input", variability="fixed", start=1.0), "variability 'fixed'"),
        (Variable("v", causality="output", initial="exact", start=1.0), "initial 'exact'"),
        (Variable("v", type="Integer", variability="continuous"), "continuous but not Real"),
        (Variable("v", variability="constant"), "constant but has to be calculated"),
        (Variable("v", unit="furlong"), "unknown unit 'furlong'"),
        (Variable("v", type="Boolean", unit="m"), "has a unit but the type Boolean"),
        (Variable("v", causality="input"), "has no start value"),
        (Variable("v", causality="output", start=1.0), "although it is calculated"),
        (Variable("v", causality="input", start=float("nan")), "has the start value nan"),
        (Variable("v", causality="input", start=4.0, maximum=3.0), "outside [None, 3.0]"),
        (Variable("v", causality="input", start=4.0, minimum=5.0), "outside [5.0, None]"),
        (Variable("v", causality="input", start=True), "not of type Real"),
        (Variable("v", type="Integer", causality="input", start=1.5), "not a 32-bit integer"),
        (Variable("v", type="Integer", causality="input", start=2**31), "not a 32-bit integer"),
        (Variable("v", type="Boolean", causality="input", start=1), "not of type Boolean"),
        (Variable("v", minimum=2.0, maximum=1.0), "minimum 2.0 above maximum 1.0"),
        (Variable("v", maximum=float("inf")), "maximum that is not finite"),
        (Variable("v", nominal=0.0), "has nominal 0.0"),
        (Variable("v", description="a\x01b"), "has a text with \\x01, which XML cannot carry"),
        (Variable("v", type="Enumeration", enumeration=("\ufffe",)), "has a text with \\ufffe"),
        (Variable("v", type="Enumeration"), "without items"),
        (Variable("v", type="Enumeration", enumeration=("a", "a")), "repeated"),
        (Variable("v", enumeration=("a",)), "has items but the type Real"),
        (Variable("v", dependencies=("nobody",)), "depends on 'nobody', which does not exist"),
        (Variable("v", dependencies=("y",)), "neither an input nor a state"),
        (Variable("v", derivative_of="y"), "does not stand in `states`"),
        (Variable("v", structured="a..b"), "has the structured name 'a..b'"),
        (Variable("v", structured="der(a"), "has the structured name 'der(a'"),
        (OUTPUT, "is there 2 times"),
    ],
)
def test_wrong_variable_is_refused(variable: Variable, words: str) -> None:
    with pytest.raises(BuildError) as caught:
        _interface(OUTPUT, variable)
    assert words in str(caught.value)
    assert repr(variable.name) in str(caught.value) or variable.derivative_of is not None


def test_namings_that_are_not_known_or_ambiguous_are_refused() -> None:
    with pytest.raises(BuildError, match="has the naming 'dotted'"):
        _interface(OUTPUT, naming="dotted")
    twins = (Variable("v_1", structured="v[1]"), Variable("w_1", structured="v[1]"))
    assert _interface(OUTPUT, *twins).shown_name(twins[0]) == "v_1"
    with pytest.raises(BuildError, match=r"'v\[1\]': is there 2 times"):
        _interface(OUTPUT, *twins, naming="structured")


def test_all_problems_are_named_at_once() -> None:
    wrong = (Variable("1x", unit="ell"), Variable("u", causality="input"), OUTPUT, OUTPUT)
    with pytest.raises(BuildError) as caught:
        _interface(*wrong, model_identifier="a b", author="\x00", default_step=0.0, stop_time=float("nan"))
    assert len(caught.value.problems) == 9, str(caught.value)


def test_states_need_derivatives() -> None:
    with pytest.raises(BuildError, match="has 0 derivatives"):
        replace(lti.INTERFACE, variables=(OUTPUT,), states=("y",))
    with pytest.raises(BuildError, match="'z': is not a variable"):
        replace(lti.INTERFACE, variables=(OUTPUT,), states=("z",))


def test_guid_follows_model_and_interface() -> None:
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", GUID)
    others = {
        lti.INTERFACE.guid("other model"),
        replace(lti.INTERFACE, description="x").guid(lti.MODEL_HASH),
        replace(lti.INTERFACE, variables=lti.VARIABLES[:-1]).guid(lti.MODEL_HASH),
    }
    assert len(others | {GUID}) == 4


def _root() -> ET.Element:
    return ET.fromstring(model_description(lti.INTERFACE, GUID).encode())


def test_description_lists_every_variable_with_its_value_reference() -> None:
    found = [(v.get("name"), int(v.get("valueReference", "-1"))) for v in _root().iter("ScalarVariable")]
    assert found == [(v.name, k) for k, v in enumerate(lti.VARIABLES)]


def test_numbers_in_the_description_read_back_bit_for_bit() -> None:
    start = 0.1 + 0.2
    interface = _interface(
        Variable("u", causality="input", start=start, minimum=-1e-300, maximum=1.0 / 3.0), OUTPUT
    )
    real = next(ET.fromstring(model_description(interface, GUID)).iter("Real"))
    assert [float(real.get(key, "nan")) for key in ("start", "min", "max")] == [start, -1e-300, 1.0 / 3.0]
    header = variables_header(interface, GUID)
    assert all(repr(number) in header for number in (start, -1e-300, 1.0 / 3.0))


def test_model_structure() -> None:
    structure = _root().find("ModelStructure")
    assert structure is not None
    names = [v.name for v in lti.VARIABLES]
    listed = {
        part.tag: {names[int(u.get("index", "0")) - 1]: u.get("dependencies") for u in part}
        for part in structure
    }
    assert listed["Outputs"] == {
        "x_1": "3",
        "scaled": "8",
        "mixed": "2 3 8",
        "in_range": "1",
        "reciprocal": "2",
    }
    assert listed["Derivatives"] == {"der_x_1": "1 2 3 8", "der_x_2": "1 2 3 8"}
    unknowns = ["x_1", "scaled", "mixed", "in_range", "reciprocal", "x_2", "der_x_1", "der_x_2"]
    assert listed["InitialUnknowns"] == dict.fromkeys(unknowns, "1 2 11 12 13")
    assert list(listed["InitialUnknowns"]) == unknowns


def test_unknown_dependencies_are_left_out() -> None:
    interface = _interface(Variable("y", causality="output", dependencies=None))
    unknown = ET.fromstring(model_description(interface, GUID)).find("ModelStructure/Outputs/Unknown")
    assert unknown is not None
    assert unknown.attrib == {"index": "1"}


# Newton = kg m/s2 and so on, written out by hand
@pytest.mark.parametrize(
    ("name", "exponents"),
    [
        ("N", {"kg": 1, "m": 1, "s": -2}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N/m", {"kg": 1, "s": -2}),
        ("N.s/m", {"kg": 1, "s": -1}),
        ("N.m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}),
        ("N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
        ("m/s2", {"m": 1, "s": -2}),
        ("Hz", {"s": -1}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("1", {}),
    ],
)
def test_units_in_base_units(name: str, exponents: dict[str, int]) -> None:
    assert UNITS[name].exponents() == exponents


def test_every_unit_is_written_and_defined() -> None:
    variables = [Variable(f"v{k}", unit=unit) for k, unit in enumerate(UNITS)]
    root = ET.fromstring(model_description(_interface(*variables), GUID))
    defined = {unit.get("name") for unit in root.iter("Unit")}
    assert defined == {real.get("unit") for real in root.iter("Real")} == set(UNITS)

"""Signals under any name, in any order, from any FMU or file: nothing here is a pantograph's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.whole_path import PLATFORMS, WholePath
from cosimulation.build import build_model
from cosimulation.data_folder import load_data_folder
from cosimulation.generate import generate_data, make_data
from cosimulation.identify import IdentifySettings, identify_from_folder
from cosimulation.settings import GenerateSettings, parse_settings
from cosimulation.validate import validate_fmu
from fmu_builder.errors import DataError, SettingsError
from identification.data_set import DataSet

HEIGHTS = (0.75, 1.25, 1.75, 2.25)


def settings(fmu: Path, inputs: dict[str, str], **changes: object) -> GenerateSettings:
    experiments: list[dict[str, object]] = [
        {"name": f"op{index}", "kind": "operating_point", "split": "train", "height": height, "duration": 8.0}
        for index, height in enumerate(HEIGHTS)
    ]
    experiments.append({"name": "wr", "kind": "whole_range", "split": "test", "duration": 10.0})
    values = {
        "reference": {"fmu": str(fmu), "start_values": {"preset": "Blow"}},
        "signals": {"inputs": inputs, "outputs": {"place": "xi", "speed": "xi_dot", "frame": "zeta"}},
        "experiments": experiments,
        "static_map": {"heights": 9},
        **changes,
    }
    return parse_settings(GenerateSettings, values, "test")


def test_a_model_of_other_signals_goes_the_whole_way(blow: WholePath, tmp_path: Path) -> None:
    chosen = settings(blow.white_box, {"lift": "eta", "drive": "M_pa"}, output=tmp_path / "data")
    folder = generate_data(chosen)
    identified = identify_from_folder(
        parse_settings(
            IdentifySettings,
            {
                "name": "machine",
                "data": folder,
                "output": tmp_path / "machine.json",
                "n4sid": {
                    "inputs": ["lift", "drive"],
                    "outputs": ["place", "speed", "frame"],
                    "scheduling": "lift",
                    "operating_point": {"lift": 1.5, "drive": 1310.9},
                },
                "derived_outputs": [
                    {
                        "name": "gap",
                        "terms": [
                            {"signal": "place", "parameter": "one"},
                            {"signal": "lift", "parameter": "one", "sign": -1},
                        ],
                        "parameters": {"one": 1.0},
                    }
                ],
            },
            "test",
        )
    )
    assert "spectral radius" in identified.text()
    fmu = build_model(str(identified.path), None, PLATFORMS)
    fits = {item["signal"]: item["fit"] for item in validate_fmu(fmu, [folder / "wr.npz"]).records}
    assert min(fits[name] for name in ("place", "speed", "frame")) >= 90.0


def test_the_order_of_the_inputs_does_not_matter(blow: WholePath) -> None:
    one, other = (
        make_data(settings(blow.white_box, {name: name for name in names}))
        for names in (("eta", "M_pa"), ("M_pa", "eta"))
    )
    assert [item.data.content_hash for item in one.experiments] == [
        item.data.content_hash for item in other.experiments
    ]
    assert one.static_map is not None
    assert other.static_map is not None
    assert np.array_equal(one.static_map.values, other.static_map.values)


def test_an_input_that_is_not_mapped_keeps_its_start_value(blow: WholePath) -> None:
    data = make_data(settings(blow.white_box, {"lift": "eta"}))
    assert data.experiments[0].data.names == ("lift", "place", "speed", "frame")


def test_more_inputs_than_can_be_drawn_are_named(blow: WholePath) -> None:
    with pytest.raises(SettingsError, match="drive, wind") as caught:
        make_data(
            settings(
                blow.white_box,
                {"eta": "eta", "drive": "M_pa", "wind": "M_pa"},
                static_map={"operating_point": {"winds": 1.0}},
            )
        )
    assert len(caught.value.problems) == 2


def recording(path: Path, unit: str) -> dict[str, object]:
    values = np.column_stack([np.linspace(1.0, 2.0, 40), np.zeros(40)])
    DataSet("recorded", 1e-3, ("eta", "xi"), (unit, "m"), values).save(path)
    return {
        "reference": {},
        "signals": {"inputs": {"eta": "eta"}, "outputs": {"xi": "xi"}},
        "experiments": [{"name": "a", "kind": "whole_range", "split": "test", "file": path}],
    }


def test_a_recording_in_another_unit_is_refused_unless_it_is_stated(tmp_path: Path) -> None:
    values = recording(tmp_path / "a.csv", "mm")
    with pytest.raises(DataError, match="'eta': is in 'mm', but eta is in 'm'"):
        make_data(parse_settings(GenerateSettings, values, "test"))
    stated = {**values, "signals": {**values["signals"], "units": {"eta": "mm"}}}  # type: ignore[dict-item]
    made = make_data(parse_settings(GenerateSettings, stated, "test"))
    assert made.experiments[0].data.units == ("mm", "m")


@pytest.mark.parametrize(
    ("key", "value"), [("origin", 3), ("inputs", 3), ("static_map", {"positions": ["x"], "values": 1})]
)
def test_a_damaged_index_is_named(tmp_path: Path, key: str, value: object) -> None:
    chosen = parse_settings(GenerateSettings, recording(tmp_path / "a.csv", "m"), "test")
    folder = generate_data(chosen.model_copy(update={"output": tmp_path / "data"}))
    index = json.loads((folder / "data.json").read_text(encoding="utf-8"))
    (folder / "data.json").write_text(json.dumps({**index, key: value}), encoding="utf-8")
    with pytest.raises(DataError, match=r"data\.json"):
        load_data_folder(folder)

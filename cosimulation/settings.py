"""Settings: one TOML file per run, checked as a whole before anything starts."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from fmu_builder.errors import Problem, SettingsError
from identification.excitation import ACCEPTANCE, ExcitationSettings

Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """A table of a settings file: frozen, and no key is accepted that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Reference(Section):
    """The FMU that the reference data come from; none where every experiment is a recorded file."""

    fmu: Path | None = Field(None, description="FMI 2.0 co-simulation FMU")
    start_values: dict[str, float | int | bool | str] = Field(
        default_factory=dict, description="of its parameters, for example preset = 'Blow'"
    )


PANTOGRAPH_UNITS = {
    "eta": "m", "M_pa": "N.m", "xi": "m", "xi_dot": "m/s", "zeta": "m", "zeta_dot": "m/s",
    "F_H": "N", "F_p": "N",
}  # fmt: skip


class Signals(Section):
    """Our signals and what the FMU or file calls them; the inputs are eta and M_pa unless said otherwise."""

    inputs: dict[str, str] = Field(default_factory=lambda: {"eta": "eta", "M_pa": "M_pa"})
    outputs: dict[str, str] = Field(
        default_factory=lambda: {name: name for name in ("xi", "xi_dot", "zeta", "zeta_dot", "F_H", "F_p")}
    )
    units: dict[str, str] = Field(
        default_factory=dict, description="of our signals, where they differ from a pantograph's"
    )

    @model_validator(mode="after")
    def _are_signals(self) -> Signals:
        names = [*self.inputs, *self.outputs]
        if not self.inputs or not self.outputs:
            raise ValueError("at least one input and one output are needed")
        if twice := sorted(set(self.inputs) & set(self.outputs)):
            raise ValueError(f"both an input and an output: {', '.join(twice)}")
        if unknown := sorted(set(self.units) - set(names)):
            raise ValueError(f"units of signals that are not mapped: {', '.join(unknown)}")
        return self

    @property
    def scheduling(self) -> str:
        """Our name of the input that carries the height: eta, or the first where none has that name."""
        return "eta" if "eta" in self.inputs else next(iter(self.inputs))

    @property
    def others(self) -> tuple[str, ...]:
        """Our names of the inputs but the height."""
        return tuple(name for name in self.inputs if name != self.scheduling)

    def unit(self, name: str) -> str:
        """Return the unit of one of our signals, "" where none is known."""
        return self.units.get(name, PANTOGRAPH_UNITS.get(name, ""))


Split = Literal["train", "validation", "test"]


class ExperimentSettings(Section):
    """One experiment; whole experiments go to one split."""

    name: str = Field(pattern=r"^[A-Za-z0-9_\-]+$")
    kind: Literal["operating_point", "whole_range"]
    split: Split
    file: Path | None = Field(None, description="recorded .csv or .npz that stands in for the FMU")
    duration: float | None = Field(None, gt=0, description="[s]; not for a file")
    height: float | None = Field(None, description="operating point of eta [m]; kind operating_point")
    low: float = Field(0.6, description="lowest height of a whole-range run, without noise [m]")
    high: float = Field(2.4, description="highest [m]")
    slew_rate: float | None = Field(
        None,
        gt=0,
        exclude_if=lambda value: value is None,  # what was written before the key came reads the same
        description="speed at which a whole-range run goes up and down [m/s]; default: once in its duration",
    )

    @model_validator(mode="after")
    def _fits_its_kind(self) -> ExperimentSettings:
        wrong = []
        if self.kind == "operating_point" and self.height is None:
            wrong.append("an operating_point experiment needs its height")
        if (self.file is None) == (self.duration is None):
            wrong.append("an experiment needs either a file or a duration")
        if not self.low < self.high:
            wrong.append(f"low {self.low:g} is not below high {self.high:g}")
        if self.slew_rate is not None and (self.kind != "whole_range" or self.file is not None):
            wrong.append("a slew_rate is of a whole_range experiment that is driven, not read from a file")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self


class StaticMapSettings(Section):
    """The static map y_e over the height, at the operating point of the torque."""

    method: Literal["automatic", "initialise", "settle", "regression"] = Field(
        "automatic",
        description="initialise: steady states from initialising the FMU; settle: by simulating it; "
        "regression: from the whole-range training data; automatic: initialise with an FMU, else regression",
    )
    low: float = 0.5
    high: float = 2.5
    operating_point: dict[str, float] = Field(
        default_factory=dict, description="of the other inputs; excitation.torque where none is given"
    )
    heights: int = Field(41, ge=9, le=10_000)
    settling_time: float = Field(20.0, gt=0, description="simulated at each height, method settle [s]")

    @model_validator(mode="after")
    def _rises(self) -> StaticMapSettings:
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} is not below high {self.high:g}")
        return self


class Noise(Section):
    """Measurement noise on the outputs of training data, standard deviations; none by default."""

    position: float = Field(0.0, ge=0, description="[m], on outputs in m")
    velocity: float = Field(0.0, ge=0, description="[m/s], on outputs in m/s")


class GenerateSettings(Section):
    """`llmn generate`: reference data from any FMU, or from recorded files."""

    seed: int = Field(1, ge=0)
    reference: Reference = Reference()
    signals: Signals = Signals()
    excitation: ExcitationSettings = ACCEPTANCE
    experiments: tuple[ExperimentSettings, ...] = ()
    static_map: StaticMapSettings = StaticMapSettings()
    noise: Noise = Noise()
    output: Path = Path("data")

    @field_validator("excitation")
    @classmethod
    def _finite(cls, excitation: ExcitationSettings) -> ExcitationSettings:
        if wrong := [name for name, value in excitation.model_dump().items() if not math.isfinite(value)]:
            raise ValueError(f"not a finite number: {', '.join(wrong)}")
        return excitation


def _known_keys(model: type[BaseModel], trail: tuple[int | str, ...]) -> list[str]:
    """Keys that the table at `trail` knows."""
    current: Any = model
    for step in trail:
        if isinstance(step, str) and isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(step)
            current = field.annotation if field else None
        inner = [
            item
            for item in (current, *get_args(current))
            if isinstance(item, type) and issubclass(item, BaseModel)
        ]
        current = inner[0] if inner else None
    if isinstance(current, type) and issubclass(current, BaseModel):
        return list(current.model_fields)
    return []


def _dotted(trail: tuple[int | str, ...]) -> str:
    text = ""
    for step in trail:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text


def _problem(model: type[BaseModel], source: str, error: Mapping[str, Any]) -> Problem:
    """Say in a user's words what pydantic found."""
    trail = tuple(error["loc"])
    place = f"{source}, {_dotted(trail)}" if trail else source
    if error["type"] == "extra_forbidden":
        known = _known_keys(model, trail[:-1])
        near = get_close_matches(str(trail[-1]), known, n=1, cutoff=0.5)
        mend = f"Did you mean {near[0]!r}?" if near else f"Known keys here: {', '.join(known)}"
        return Problem(place, "there is no such key", mend.rstrip("."))
    if error["type"] == "missing":
        return Problem(place, "this key is needed and missing", "Add it")
    found = error.get("input")
    what = str(error["msg"]).removeprefix("Value error, ")
    if isinstance(found, Mapping):  # a whole table, or the whole file, says nothing
        return Problem(place, what, "Change the values")
    return Problem(place, f"{what} (found {found!r})", "Change the value")


def parse_settings(model: type[Model], values: Mapping[str, Any], source: str) -> Model:
    """Check values against a settings model.

    Args:
        model: The settings to read.
        values: As read from TOML.
        source: Name of the file, for messages.

    Raises:
        SettingsError: Names every key that is unknown, missing or of a wrong value, all at once.
    """
    try:
        return model.model_validate(values)
    except ValidationError as reason:
        raise SettingsError([_problem(model, source, dict(error)) for error in reason.errors()]) from reason


def load_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        SettingsError: The file is missing, unreadable or not TOML.
    """
    try:
        with path.open("rb") as stream:
            return tomllib.load(stream)
    except FileNotFoundError as reason:
        raise SettingsError.of(
            str(path), "there is no such settings file", "Give the path of a TOML file"
        ) from reason
    except (OSError, UnicodeDecodeError) as reason:
        raise SettingsError.of(
            str(path), f"cannot be read ({reason})", "Give a readable TOML file"
        ) from reason
    except tomllib.TOMLDecodeError as reason:
        raise SettingsError.of(str(path), f"is not valid TOML ({reason})", "Mend that line") from reason


def load_settings(model: type[Model], path: Path) -> Model:
    """Read and check a settings file; relative paths in it stay relative to the working folder.

    Raises:
        SettingsError: See `load_toml` and `parse_settings`.
    """
    return parse_settings(model, load_toml(path), str(path))


def with_flags(settings: Model, **flags: object) -> Model:
    """Return settings in which flags of the command line stand in for keys; None is no flag.

    Raises:
        SettingsError: A flag has a value that the key refuses.
    """
    given = {key: value for key, value in flags.items() if value is not None}
    return parse_settings(type(settings), {**dict(settings), **given}, "command line")


def toml_value(value: Any) -> str:
    """Return a value as a TOML file writes it, on one line."""
    if isinstance(value, BaseModel):
        return toml_value(value.model_dump(exclude_defaults=True))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {toml_value(item)}" for name, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return json.dumps(value, default=str)


def deviations(settings: BaseModel, usual: BaseModel | None = None) -> dict[str, Any]:
    """Return every value that differs from the usual settings by its dotted key.

    Args:
        settings: The settings.
        usual: Settings of the same class to compare with; the defaults if None.
    """
    found: dict[str, Any] = {}
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        other = field.get_default(call_default_factory=True) if usual is None else getattr(usual, name)
        if value == other:
            continue
        if isinstance(value, BaseModel) and type(value) is type(other):
            found |= {f"{name}.{key}": item for key, item in deviations(value, other).items()}
        else:
            found[name] = value
    return found


_LONGEST_VALUE = 40


def settings_line(settings: BaseModel, source: Path, usual: BaseModel | None = None) -> str:
    """Return one line on where settings come from and what in them is unusual; long values by name only."""
    parts = []
    for key, value in deviations(settings, usual).items():
        text = toml_value(value)
        count = f" ({len(value)} entries)" if isinstance(value, list | tuple) else ""
        parts.append(f"{key} = {text}" if len(text) <= _LONGEST_VALUE else f"{key}{count}")
    return f"settings: {source}; " + (f"not the default: {', '.join(parts)}" if parts else "all defaults")


STUDIES = Path(__file__).parent / "studies"


def load_shipped_settings(model: type[Model], name: str) -> Model:
    """Read a settings file that comes with the project.

    Args:
        model: The settings to read.
        name: A file in `cosimulation/studies`.
    """
    return load_settings(model, STUDIES / name)

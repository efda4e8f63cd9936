"""From views to the page: what the template shows."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from cosimulation.pantograph import SIGNALS
from cosimulation.report import thesis
from cosimulation.report.bands import outside_rows, set_tables, without_bands
from cosimulation.report.choices import ORDER_RULE, ChoiceRow, choice_rows
from cosimulation.report.figures.bands import bands_figure
from cosimulation.report.figures.contact_force import close_up_figure, overview_figure, scheduled
from cosimulation.report.figures.poles import poles_figure
from cosimulation.report.figures.singular_values import singular_values_figure
from cosimulation.report.figures.spectra import SEGMENT_SECONDS, spectra_figure
from cosimulation.report.figures.summary import summary_figure
from cosimulation.report.modes import FURTHEST
from cosimulation.report.surrogate import surrogate_tables
from cosimulation.report.tables import fit_rows, mode_names, pole_rows, step_rows
from cosimulation.report.template import rendered
from cosimulation.report.verdict import percent, verdict
from cosimulation.report.views import SetView, views
from fmus.wbm import parameter_sets
from identification.residuals import SPECIFIED
from identification.scores import SCORED_FRACTION

if TYPE_CHECKING:
    from cosimulation.demo import DemoResult

LIBRARIES = (
    "pantograph-llmn", "numpy", "scipy", "control", "fmpy", "pydantic", "matplotlib", "jinja2", "ziglang",
)  # fmt: skip
CONTENTS = (
    ("verdict", "Verdict"),
    ("what", "What this is"),
    ("fit", "FIT per signal"),
    ("time", "Contact force over time"),
    ("spectra", "Spectra"),
    ("bands", "How far off is the contact force?"),
    ("order", "Order and other choices"),
    ("poles", "Poles"),
    ("surrogate", "Surrogate"),
    ("speed", "Step times"),
    ("made", "How it was made"),
)
_SYMBOLS = {
    "xi": "&#958;",
    "xi_dot": "&#958;&#775;",
    "zeta": "&#950;",
    "zeta_dot": "&#950;&#775;",
    "F_H": "F<sub>H</sub>",
    "F_p": "F<sub>p</sub>",
}
_KINDS = {"operating_point": "operating point", "whole_range": "whole range"}


def render(result: DemoResult) -> str:
    """Return the whole page."""
    sets = views(result)
    return rendered(
        "report.html.jinja",
        contents=CONTENTS,
        quick=result.quick,
        thesis_best=percent(thesis.BEST_CONTACT_FORCE),
        linear_remark=thesis.LINEAR_REMARK,
        scored_percent=f"{100.0 * SCORED_FRACTION:g}",
        specified=f"{SPECIFIED:g}",
        segment=f"{SEGMENT_SECONDS:.3g}",
        furthest=f"{FURTHEST:g}",
        order_rule=ORDER_RULE,
        signals=_signals(sets[0]),
        recipe=_recipe(sets[0]),
        summary=Markup(summary_figure(sets)),
        sets=[_set_content(view) for view in sets],
        step_rows=step_rows(sets, result.timings["steps"]),
        machine=f"{platform.system()} {platform.machine()}",
        versions=_versions(),
    )


def _set_content(view: SetView) -> dict[str, Any]:
    """Return what the template shows of one white-box set."""
    found, shown = verdict(view), scheduled(view)
    physical = parameter_sets()[view.name]
    origin = view.result.data.origin
    return {
        "name": view.name,
        "negative": percent(100.0 * float((view.reference("F_p") < 0.0).mean()), 0),
        "verdict": found,
        "fit": percent(found.fit),
        "description": physical.description,
        "best": found.best.title,
        "head_stiffness": f"{physical['k_C'] / 1000.0:.4g}",
        "experiments": _experiments(view),
        "fit_rows": fit_rows(view),
        "overview": Markup(overview_figure(view)),
        "close_up": Markup(close_up_figure(view)),
        "spectra": Markup(spectra_figure(view)),
        "bands": set_tables(view),
        "bands_figure": Markup(bands_figure(view)),
        "without_bands": without_bands(view),
        "outside_rows": outside_rows(view),
        "singular_values": _singular_values(view),
        "choices": _choices(view),
        "warnings": view.result.warnings,
        "poles": Markup(poles_figure(view)),
        "weights_go_on": shown is not None
        and shown.parameter_set.partition.validity in ("hat", "cubic", "cubic_warp"),
        "mode_names": mode_names(view),
        "pole_rows": pole_rows(view),
        "surrogates": surrogate_tables(view),
        "hashes": _hashes(view),
        "settings": _json(origin["settings"]),
        "model_settings": [
            (model.title, _json(_model_settings(model.parameter_set.provenance))) for model in view.models
        ],
    }


def _singular_values(view: SetView) -> Markup:
    """Return the figure of the set's local models, which all its n4sid networks share."""
    local = next((model.candidate.local for model in view.models if model.candidate.local is not None), None)
    return Markup("" if local is None else singular_values_figure(local, view.name))


def _choices(view: SetView) -> list[ChoiceRow]:
    """Return every choice once: those of the local models, then those of single networks."""
    rows: dict[ChoiceRow, None] = {}
    for model in view.models:
        rows |= dict.fromkeys(choice_rows(model.candidate.choices, model.title))
    return list(rows)


def _signals(view: SetView) -> list[dict[str, Any]]:
    model = view.models[0]
    return [
        {
            "name": f"{name} [{model.unit(name)}]",
            "symbol": Markup(_SYMBOLS.get(name, name)),
            "meaning": model.meaning(name),
        }
        for name in SIGNALS
    ]


def _recipe(view: SetView) -> dict[str, str]:
    """Return how the data were made, in words and numbers."""
    settings = view.result.data.origin["settings"]
    excitation, noise = settings["excitation"], settings["noise"]
    test = view.models[0].runs["test"].experiment
    shape = next(item for item in settings["experiments"] if item["name"] == test.name)
    duration = len(test.data) * test.data.sample_time
    speed = 2.0 * (shape["high"] - shape["low"]) / duration
    bias = 0.5 * parameter_sets()[view.name]["k_E"] * speed * view.sample_time
    noisy = any(value > 0.0 for value in noise.values())
    spoken = f"Measurement noise on training outputs: {noise['position']:g} m, {noise['velocity']:g} m/s."
    return {
        "sample_time": f"{1000.0 * excitation['sample_time']:g}",
        "noise": f"{1000.0 * excitation['noise_rms']:g}",
        "corner": f"{excitation['corner_frequency']:g}",
        "torque": f"{excitation['torque']:g}",
        "amplitude": f"{excitation['torque_amplitude']:g}",
        "hold": f"{1000.0 * excitation['hold_minimum']:g} to {1000.0 * excitation['hold_maximum']:g}",
        "low": f"{shape['low']:g}",
        "high": f"{shape['high']:g}",
        "seed": str(settings["seed"]),
        "hold_bias": f"{bias:.2g}",
        "measurement_noise": spoken if noisy else "There is no measurement noise.",
    }


def _experiments(view: SetView) -> list[dict[str, str]]:
    return [
        {
            "name": item.name,
            "kind": _KINDS.get(item.kind, item.kind),
            "split": item.split,
            "height": "" if item.height is None else f"{item.height:g}",
            "duration": f"{len(item.data) * item.data.sample_time:g}",
        }
        for item in view.result.data.experiments
    ]


def _hashes(view: SetView) -> list[tuple[str, str]]:
    """Return what identifies reference, data and models."""
    data = view.result.data
    found = []
    reference = data.origin.get("reference")
    if reference:
        found.append((f"reference FMU, {reference['model']}", reference["sha256"]))
    found += [(f"data {item.name} (content)", item.data.content_hash) for item in data.experiments]
    found += [(f"model {model.candidate.name}", model.parameter_set.model_hash()) for model in view.models]
    return found


def _model_settings(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a parameter set says about its making, less the reference data's own settings."""
    return {name: value for name, value in provenance.items() if name != "origin"}


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, sort_keys=True)


def _versions() -> str:
    """Return the versions of everything the figures depend on."""
    found = [f"Python {platform.python_version()}"]
    for name in LIBRARIES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} (not installed as a package)")
    return ", ".join(found)

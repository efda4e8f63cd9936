"""The command `llmn`."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from cosimulation.progress import SILENT, Reporter
from cosimulation.threads import one_thread_each
from fmu_builder.errors import LlmnError, SettingsError

app = typer.Typer(
    name="llmn",
    help="From a slow reference model to a small real-time model that runs everywhere.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Settings = Annotated[Path, typer.Argument(help="Settings file (TOML).", show_default=False)]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON on stdout, and nothing on stderr.")
]

Platforms = Annotated[
    list[str] | None,
    typer.Option(help="FMI platform folder, several allowed; all by default.", show_default=False),
]


def _reporter(as_json: bool) -> Reporter:
    return SILENT if as_json else Reporter()


def _print(result: dict[str, object], as_json: bool, text: str) -> None:
    typer.echo(json.dumps(result, indent=2) if as_json else text)


def _start_values(pairs: list[str]) -> dict[str, float | int | bool | str]:
    """Read NAME=VALUE: a number where it is one, otherwise text."""
    found: dict[str, float | int | bool | str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise SettingsError.of(f"--start {pair}", "has no '='", "Write NAME=VALUE")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = value
    return found


def _version(asked: bool) -> None:
    if asked:
        typer.echo(version("pantograph-llmn"))
        raise typer.Exit


@app.callback()
def common(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """From a slow reference model to a small real-time model that runs everywhere."""


@app.command()
def demo(
    output: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("runs/demo"),
    quick: Annotated[
        bool, typer.Option(help="Short data: shows every step in a fraction of the time; worse figures.")
    ] = False,
    platform: Platforms = None,
    as_json: Json = False,
) -> None:
    """Run the pantograph from the white-box model to the report."""
    from cosimulation.demo import run_demo
    from fmu_builder.fmi2 import DEFAULT_PLATFORMS

    chosen = tuple(platform or DEFAULT_PLATFORMS)
    result = run_demo(output, quick=quick, reporter=_reporter(as_json), platforms=chosen)
    _print(result.summary(), as_json, result.text())


@app.command()
def generate(
    settings: Settings,
    reference: Annotated[
        Path | None, typer.Option(help="Reference FMU; stands in for `reference.fmu`.", show_default=False)
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Stands in for `seed`.", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option(help="Stands in for `output`.", show_default=False)] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            help="Start value NAME=VALUE of the reference FMU, several allowed.", show_default=False
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Make reference data: drive any FMU, or read recorded files, by a settings file."""
    from cosimulation.generate import generate_data
    from cosimulation.settings import GenerateSettings, load_settings, settings_line, with_flags

    chosen = load_settings(GenerateSettings, settings)
    given: dict[str, object] = {} if reference is None else {"fmu": reference}
    if start:
        given["start_values"] = {**chosen.reference.start_values, **_start_values(start)}
    driven = chosen.reference.model_copy(update=given) if given else None
    chosen = with_flags(chosen, seed=seed, output=output, reference=driven)
    reporter = _reporter(as_json)
    reporter.say(settings_line(chosen, settings))
    folder = generate_data(chosen, reporter)
    _print({"data": str(folder)}, as_json, f"reference data: {folder}")


@app.command()
def identify(
    settings: Settings,
    data: Annotated[
        Path | None, typer.Option(help="Data folder; stands in for `data`.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Parameter set to write; stands in for `output`.", show_default=False)
    ] = None,
    as_json: Json = False,
) -> None:
    """Identify a local linear model network from reference data."""
    from cosimulation.identify import IdentifySettings, identify_from_folder
    from cosimulation.settings import load_settings, settings_line, with_flags

    chosen = with_flags(load_settings(IdentifySettings, settings), data=data, output=output)
    reporter = _reporter(as_json)
    reporter.say(settings_line(chosen, settings))
    result = identify_from_folder(chosen, reporter)
    _print(result.summary(), as_json, result.text())


@app.command()
def build(
    model: Annotated[
        str,
        typer.Argument(
            help="A parameter set (.json), or wbm, surrogate, n4sid, surrogate_blow, n4sid_blow.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(help="FMU to write; beside the parameter set, or here, by default.", show_default=False),
    ] = None,
    platform: Platforms = None,
    backend: Annotated[
        str, typer.Option(help="`native`, or `pythonfmu`: NumPy inside, for fmpy only.")
    ] = "native",
    names: Annotated[
        str, typer.Option(help="`flat`, which every importer takes, or `structured`: theta[2].m_H, der(xi).")
    ] = "flat",
    as_json: Json = False,
) -> None:
    """Package a parameter set as an FMU, or build one that comes with the project."""
    from cosimulation.build import Backend, Naming, build_model

    for option, given, choices in (("backend", backend, Backend), ("names", names, Naming)):
        known = [item.value for item in choices]
        if given not in known:
            raise SettingsError.of(f"--{option} {given}", "is not known", f"Use one of: {', '.join(known)}")
    path = build_model(model, output, tuple(platform or ()), Backend(backend), Naming(names))
    _print({"fmu": str(path)}, as_json, f"FMU: {path}")


@app.command()
def check(
    fmu: Annotated[list[Path], typer.Argument(help="FMUs (FMI 2.0), anybody's.", show_default=False)],
    static: Annotated[
        bool, typer.Option("--static", help="Look at the files only: run and compile nothing.")
    ] = False,
    time_limit: Annotated[
        float, typer.Option(help="Of each experiment with the binary [s].", min=1.0)
    ] = 60.0,
    as_json: Json = False,
) -> None:
    """Say everything that keeps an FMU from dropping in anywhere; exit status 1 when there are errors."""
    from cosimulation.check import check_files

    result = check_files(fmu, static, time_limit, _reporter(as_json))
    _print(result.summary(), as_json, result.text())
    if not result.passed:
        raise typer.Exit(1)


@app.command()
def validate(
    fmu: Annotated[Path, typer.Argument(help="The FMU to judge.", show_default=False)],
    data: Annotated[
        list[Path],
        typer.Option(help="Experiments (.npz or .csv) to compare with, several allowed.", show_default=False),
    ],
    reference: Annotated[
        Path | None,
        typer.Option(
            help="Compare with this FMU on the same inputs, not with the record.", show_default=False
        ),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            help="Start value NAME=VALUE of the reference FMU, several allowed.", show_default=False
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Write the scores to this JSON file.", show_default=False)
    ] = None,
    as_json: Json = False,
) -> None:
    """Co-simulate an FMU on the inputs of recorded experiments and score its outputs."""
    from cosimulation.validate import validate_fmu

    result = validate_fmu(fmu, data, reference, _start_values(start or []), _reporter(as_json))
    if output is not None:
        result.save(output)
    _print(result.summary(), as_json, result.text())


@app.command()
def prove(
    file: Annotated[
        Path, typer.Argument(help="A parameter set (.json), or the FMU of one.", show_default=False)
    ],
    rate: Annotated[
        float | None,
        typer.Option(
            help="Rate of the scheduling variable to look for, its unit per second; where none is given and"
            " none stored 6, or the largest below it.",
            show_default=False,
        ),
    ] = None,
    data: Annotated[
        list[Path] | None,
        typer.Option(help="Experiments to compute the FIT on that stands beside.", show_default=False),
    ] = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Look for a certificate even where one is stored.")
    ] = False,
    store: Annotated[
        bool, typer.Option("--store", help="Write the certificate found into the parameter set.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Prove in exact arithmetic that a network is stable, or say why not; exit status 1 without a proof."""
    from cosimulation.prove import prove_file

    result = prove_file(file, rate, tuple(data or ()), anew=anew, store=store, reporter=_reporter(as_json))
    _print(result.summary(), as_json, result.text())


@app.command()
def region(
    file: Annotated[Path, typer.Argument(help="A parameter set (.json).", show_default=False)],
    data: Annotated[Path, typer.Option(help="Data folder with its training data.", show_default=False)],
    store: Annotated[bool, typer.Option("--store", help="Write the region into the parameter set.")] = False,
    as_json: Json = False,
) -> None:
    """Work out where a network was trained, for parameter sets that do not say it."""
    from cosimulation.region import region_of_file

    result = region_of_file(file, data, store=store)
    _print(result.summary(), as_json, result.text())


@app.command()
def study(
    name: Annotated[
        str,
        typer.Argument(
            help="order, blending, surrogate, shipped, white_box, lolimot, compare, contact, extrapolation.",
            show_default=False,
        ),
    ],
    settings: Annotated[
        Path | None,
        typer.Option(help="Settings file that stands in for the one that comes with it.", show_default=False),
    ] = None,
    seed: Annotated[
        list[int] | None, typer.Option(help="Stands in for `seeds`, several allowed.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(help="Folder of the results; runs/study-NAME by default.", show_default=False),
    ] = None,
    as_json: Json = False,
) -> None:
    """Run a study over several seeds and compare its figures with its limits."""
    from cosimulation.study import run_study

    result = run_study(name, output, settings, tuple(seed or ()), _reporter(as_json))
    _print(result.summary(), as_json, result.text())
    if not result.passed:
        raise typer.Exit(1)


@app.command()
def sweep(
    settings: Settings,
    output: Annotated[Path | None, typer.Option(help="Stands in for `output`.", show_default=False)] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Run on the Dask cluster of this scheduler: tcp://HOST:PORT.", show_default=False),
    ] = None,
    processes: Annotated[
        int | None, typer.Option(help="Stands in for `processes`.", show_default=False)
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Run again what failed, crashed or took too long earlier.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run models x signals x parameters x seeds, or what is left of it; exit status 1 when a run failed."""
    from cosimulation.settings import load_settings, settings_line, with_flags
    from cosimulation.sweep import SweepSettings, run_sweep

    chosen = with_flags(load_settings(SweepSettings, settings), output=output, processes=processes)
    reporter = _reporter(as_json)
    reporter.say(settings_line(chosen, settings))
    try:
        result = run_sweep(chosen, scheduler, retry, reporter)
    except KeyboardInterrupt:
        raise typer.Exit(130) from None
    _print(result.summary(), as_json, result.text())
    if not result.passed:
        raise typer.Exit(1)


def main() -> None:
    """Run the command; every error a user can mend is one message and exit status 1."""
    one_thread_each()  # before the commands load numpy
    try:
        app()
    except LlmnError as error:
        for problem in error.problems:
            print(f"llmn: {problem}", file=sys.stderr)
        sys.exit(1)
    except MemoryError as reason:
        print(
            f"llmn: memory: does not suffice ({reason}). Shorten the data or the settings.", file=sys.stderr
        )
        sys.exit(1)
    except OSError as reason:
        print(
            f"llmn: {reason.filename or 'output'}: {reason.strerror or reason}. Check disk and rights.",
            file=sys.stderr,
        )
        sys.exit(1)

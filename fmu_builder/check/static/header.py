"""The root of the description: identifiers, date, capabilities, default experiment, source files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from fmu_builder.check.archive import DESCRIPTION
from fmu_builder.check.description import IDENTIFIER, Description, number, place_of
from fmu_builder.check.finding import Finding, Severity, practice, standard

_DATE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", re.ASCII)
_LONGEST_IDENTIFIER = 63
_SECTION = {"CoSimulation": "4.3.1", "ModelExchange": "3.3.1"}
_KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile
    while
    """.split()  # noqa: SIM905 - forty names read better as text
)


def _identifier_findings(description: Description) -> Iterator[Finding]:
    for kind, attributes in description.interfaces.items():
        name = attributes.get("modelIdentifier", "")
        place = f"{DESCRIPTION}, {kind}"
        paragraph = standard(_SECTION[kind])
        if not IDENTIFIER.fullmatch(name) or name in _KEYWORDS:
            what = (
                f"modelIdentifier {name!r} is not a C identifier; it begins the names of functions and files"
            )
            mend = "Use letters, digits and underscores, no digit first"
            yield Finding(Severity.ERROR, "model-identifier", place, what, paragraph, mend)
        elif len(name) > _LONGEST_IDENTIFIER:
            what = f"modelIdentifier has {len(name)} characters"
            mend = f"Use at most {_LONGEST_IDENTIFIER}"
            yield Finding(Severity.WARNING, "model-identifier", place, what, practice("C compilers"), mend)


def _text_findings(description: Description) -> Iterator[Finding]:
    attributes = description.attributes
    place = place_of(description.root.sourceline)
    if not attributes.get("guid", "").strip():
        mend = "Give a hash of the content, the same in the binary"
        yield Finding(Severity.ERROR, "guid", place, "the guid is empty", standard("2.2.1"), mend)
    if not attributes.get("modelName", "").strip():
        yield Finding(
            Severity.ERROR, "model-name", place, "modelName is empty", standard("2.2.1"), "Name the model"
        )
    date = attributes.get("generationDateAndTime")
    if date is not None and not _is_date(date):
        what = f"generationDateAndTime {date!r} is not of the form YYYY-MM-DDThh:mm:ssZ"
        mend = "Write a time of UTC in this form"
        yield Finding(Severity.ERROR, "date", place, what, standard("2.2.1"), mend)


def _is_date(text: str) -> bool:
    if not _DATE.fullmatch(text):
        return False
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return False
    return True


def _is_true(attributes: object, name: str) -> bool:
    return isinstance(attributes, dict) and attributes.get(name) in ("true", "1")


def _capability_findings(description: Description) -> Iterator[Finding]:
    for kind, attributes in description.interfaces.items():
        place, paragraph = f"{DESCRIPTION}, {kind}", standard(_SECTION[kind])
        get_set = _is_true(attributes, "canGetAndSetFMUstate")
        serialize = _is_true(attributes, "canSerializeFMUstate")
        if serialize and not get_set:
            what = "canSerializeFMUstate is true but canGetAndSetFMUstate is not"
            mend = "Declare both, or neither"
            yield Finding(Severity.ERROR, "serialize-without-state", place, what, paragraph, mend)
        if _is_true(attributes, "needsExecutionTool"):
            what = "needs another program at run time"
            mend = "Export it stand-alone where it has to run on other machines"
            yield Finding(Severity.NOTE, "execution-tool", place, what, paragraph, mend)
        order = number(attributes.get("maxOutputDerivativeOrder", "0"))
        if order is not None and order < 0:
            what, mend = f"maxOutputDerivativeOrder is {order:g}", "Give 0 or more"
            yield Finding(Severity.ERROR, "derivative-order", place, what, paragraph, mend)


def _experiment_findings(description: Description) -> Iterator[Finding]:
    element = description.root.find("DefaultExperiment")
    if element is None:
        return
    start, stop, step, tolerance = (
        number(element.get(name)) for name in ("startTime", "stopTime", "stepSize", "tolerance")
    )
    wrong = []
    if stop is not None and not stop > (start or 0.0):
        wrong.append(f"stopTime {stop:g} is not after startTime {start or 0.0:g}")
    if step is not None and not 0.0 < step < float("inf"):
        wrong.append(f"stepSize {step:g} is not a positive number")
    if tolerance is not None and not 0.0 < tolerance < float("inf"):
        wrong.append(f"tolerance {tolerance:g} is not a positive number")
    for what in wrong:
        place, mend = place_of(element.sourceline), "Propose values that can be run"
        yield Finding(Severity.ERROR, "default-experiment", place, what, standard("2.2.5"), mend)


def _category_findings(description: Description) -> Iterator[Finding]:
    elements = list(description.root.iterfind("LogCategories/Category"))
    for name, count in Counter(element.get("name", "") for element in elements).items():
        if count > 1:
            place, what = (
                place_of(elements[0].sourceline),
                f"the log category {name!r} is there {count} times",
            )
            yield Finding(
                Severity.ERROR, "log-category", place, what, standard("2.2.4"), "List each category once"
            )


def _source_findings(description: Description, folder: Path) -> Iterator[Finding]:
    sources = folder / "sources"
    inside = {file.relative_to(sources).as_posix() for file in sources.rglob("*") if file.is_file()}
    for kind, names in description.sources.items():
        place, paragraph = f"{DESCRIPTION}, {kind}/SourceFiles", standard(_SECTION[kind])
        for name, count in Counter(names).items():
            if name not in inside:
                what = f"lists {name!r}, which is not in sources/"
                mend = "List exactly the files to compile, relative to sources/"
                yield Finding(Severity.ERROR, "source-file", place, what, paragraph, mend)
            if count > 1:
                what, mend = f"lists {name!r} {count} times", "List each file once"
                yield Finding(Severity.ERROR, "source-file", place, what, paragraph, mend)
    given = any(name.endswith(".c") for name in inside)
    if given and not any(description.sources.values()):
        what = "sources/ holds C files, but SourceFiles does not say which to compile"
        place, mend = DESCRIPTION, "List the files to compile"
        yield Finding(Severity.WARNING, "source-file", place, what, standard("2.3"), mend)


def header_findings(description: Description, folder: Path) -> Iterator[Finding]:
    """Yield what is wrong with the description apart from variables, units and structure.

    Args:
        description: The description.
        folder: Where the FMU is unpacked.
    """
    yield from _identifier_findings(description)
    yield from _text_findings(description)
    yield from _capability_findings(description)
    yield from _experiment_findings(description)
    yield from _category_findings(description)
    yield from _source_findings(description, folder)

"""Reading a case file: its curves of sizes, keys, and values with units; the shipped cases."""

import copy
import csv
import difflib
import itertools
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from fdnet.case.case import Case, InvasionCase, case_type, cross_problems, without_old_keys
from fdnet.case.spheres import Sizes
from fdnet.case.tables import Part
from fdnet.case.units import SUFFIXES, converted, length_factor, share_of, stem_of, suffix_of
from fdnet.errors import CaseError
from fdnet.files import SMALL, expanded, file_bytes, text_of

# ---- Curves of sizes in CSV files: tables of sieves and of laser instruments.
_BRACKETS = re.compile(r"[(\[]([^)\]]*)[)\]]")
_FINER = r"passing|finer|under|smaller|less|<"
_COARSER = r"retained|over|coarser|larger|greater|>"
_RADII = r"radi|^r$"
_POWERS = {
    "mass": r"mass|weight|\bwt|vol|q3",
    "number": r"number|count|\bnum|\bno\b|\bnr\b|q0",
    "surface": r"surface|area|q2",
    "length or intensity": r"length|intensity|q1",
}
"""What the shares of a column may count, with the words that say it."""
_MOST_FRACTION = 1.0 + 1e-9


def read_size_file(
    folder: Path, name: str, *, by: str = "mass"
) -> tuple[list[float], list[float]]:
    """Diameters, mm, that rise, and the percentage finer than each, from a CSV file.

    The first line that is no comment (#) names the columns, with their units: one of sizes
    ("size_um", "Diameter (mm)", or "Radius (mm)", which is doubled) and one cumulative percentage
    ("passing %", "cumulative % retained", which is turned around, or "fraction finer" of 1). The
    text is UTF-8, UTF-16 or Windows-1252. `by` is what the case says that the percentages count.
    Raises ValueError, with the file and what was expected, where it cannot be read so.
    """
    path = folder / expanded(name)
    try:
        text = text_of(file_bytes(path, most=SMALL, what="a table of sizes"), path)
    except CaseError as error:
        raise ValueError(str(error)) from error
    try:
        return parse_sizes(text, by=by)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_sizes(text: str, *, by: str = "mass") -> tuple[list[float], list[float]]:
    """As `read_size_file`, of the text of a file."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 3:
        raise ValueError("expected a line of column names and at least two rows")
    delimiter = next((one for one in (";", "\t", ",") if one in lines[0]), ",")
    try:
        header, *rows = list(csv.reader(lines, delimiter=delimiter))
    except csv.Error as error:
        raise ValueError(f"{error}; expected comma-separated values") from error
    sizes, factor = _size_column(header)
    percents, retained, whole = _share_column(header, sizes, by)
    points = [_row(row, sizes, percents, comma=delimiter != ",") for row in rows]
    if points[0][0] > points[-1][0]:
        points.reverse()
    largest = max(share for _, share in points)
    if (0 < largest <= _MOST_FRACTION) != (whole == 1):
        raise ValueError(
            f"column {header[percents]!r}: its numbers end at {largest:g}, expected {whole:g}; "
            "name it with % where it holds percentages, and 'fraction finer' or 'cumulative "
            "fraction retained' where it holds fractions of 1"
        )
    finer = [100 * (whole - share if retained else share) / whole for _, share in points]
    return [size * factor for size, _ in points], finer


def _size_column(header: list[str]) -> tuple[int, float]:
    """Index of the column of sizes and the factor that makes diameters, mm, of its numbers."""
    columns = []
    for index, name in enumerate(header):
        last = re.split(r"[\s_,]+", name.strip())[-1]
        for unit in (*_BRACKETS.findall(name), last):
            factor = length_factor(unit)
            if factor is not None and "%" not in name:
                columns.append((index, factor, name.replace(unit, "").strip(" _,()[]").lower()))
                break
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} have a unit of length, expected one, named such "
            "as 'size_um' or 'Diameter (mm)'"
        )
    index, factor, words = columns[0]
    return index, 2 * factor if re.search(_RADII, words) else factor


def _share_column(header: list[str], sizes: int, by: str) -> tuple[int, bool, float]:
    """Index of the column of cumulative shares, whether it counts what is coarser, its whole."""
    columns = []
    for index, name in enumerate(header):
        words = name.lower()
        percent = "%" in words or "percent" in words
        cumulative = "cum" in words
        finer, coarser = bool(re.search(_FINER, words)), bool(re.search(_COARSER, words))
        if index == sizes or not (percent or "fraction" in words):
            continue
        if finer and coarser:
            raise ValueError(f"column {name!r}: finer or coarser? Name it 'passing %', or so")
        if coarser and not cumulative:
            raise ValueError(
                f"column {name!r}: is it the share on each sieve, or on it and all above? "
                "Name it 'cumulative % retained' if it is the latter"
            )
        if finer or coarser or cumulative:
            columns.append((index, coarser, 100.0 if percent else 1.0))
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} are cumulative percentages, expected one, named "
            "such as 'passing %', 'cumulative % finer' or 'cumulative % retained'"
        )
    name, own = header[columns[0][0]], "mass" if by == "volume" else by
    said = {power for power, words in _POWERS.items() if re.search(words, name.lower())}
    if said - {own}:
        raise ValueError(
            f"column {name!r}: counts {' and '.join(sorted(said))}, but the case says by {by!r}; "
            "give by = what the column counts (mass, volume, surface or number) next to the file"
        )
    return columns[0]


def _row(row: list[str], sizes: int, percents: int, *, comma: bool) -> tuple[float, float]:
    values = []
    for index in (sizes, percents):
        cell = row[index].strip() if index < len(row) else ""
        try:
            values.append(float(cell.replace(",", ".") if comma else cell))
        except ValueError:
            raise ValueError(
                f"row {row}: {cell!r} is no number; units stand in the names of the columns"
            ) from None
    return values[0], values[1]


# ---- The keys of a case file, and the one that an unknown key means.
_DIAMETER = re.compile(r"[dD]_?\d\d")


def known_keys(model: type[Part] = InvasionCase, prefix: str = "") -> Iterator[str]:
    """Every dotted key that a case file may hold."""
    for name, info in model.model_fields.items():
        yield prefix + name
        table = table_of(info.annotation)
        if table is not None:
            yield from known_keys(table, f"{prefix}{name}.")


def table_of(annotation: Any) -> type[Part] | None:
    """The table that a key holds, one or a list of them, or none; None for a plain value."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return annotation
    return next((one for kind in get_args(annotation) if (one := table_of(kind))), None)


REMOVED_KEYS = {
    "clean_up.lift_cake": "the cake is always lifted, remove the key",
    "clean_up.quiet_ms": "give clean_up.duration_ms, or leave it out",
    "clean_up.cap_ms": "give clean_up.duration_ms, or leave it out",
    "run.skin_mm": "fdnet chooses the neighbour search, remove the key",
    "run.neighbour_bin_mm": "fdnet chooses the neighbour search, remove the key",
}
"""Keys that are gone, and what to do without each."""


def nearest(path: str) -> str:
    """The known key that is nearest to an unknown one, in words; empty where none is near."""
    table, _, key = path.rpartition(".")
    if path in REMOVED_KEYS:
        return f"; {REMOVED_KEYS[path]}"
    if table in ("grains", "fines") and _DIAMETER.match(key):
        return f'; did you mean {table}.sizes = {{ D10 = "20 um", D50 = "40 um", ... }}?'

    def likeness(one: str) -> float:
        """Of the spelling without units, 0 to 1; a key of the same table is likelier."""
        other, _, name = one.rpartition(".")
        alike = difflib.SequenceMatcher(None, stem_of(key), stem_of(name)).ratio()
        return alike + 0.2 * (other == table)

    best = max(known_keys(), key=likeness)
    return f"; did you mean {best}?" if likeness(best) >= 0.75 else ""


# ------------------------------------------------------------------------------------------------
# Case files as people write them: values with their units, and curves in files of their own.
#
# A key without the unit in its name takes a text with the unit, `viscosity = "10 cP"`, and stands
# for the key with the unit, `viscosity_cP = 10`. A share takes a percentage, `porosity = "38 %"`.


FILE = "file"  # Key of a table of sizes that names a file with the curve


@dataclass(slots=True)
class Spoken:
    """Nested tables in the keys of the models."""

    folder: Path  # where files that the case names are looked for
    data: dict[str, Any] = field(default_factory=dict)  # the tables
    # what could not be understood, one sentence each
    problems: list[str] = field(default_factory=list)
    # dotted keys, of at most two parts, whose value was refused
    bad: set[str] = field(default_factory=set)

    def refuse(self, key: str, problem: str) -> None:
        """Note a problem with the dotted `key`."""
        self.problems.append(f"{key}: {problem}")
        self.bad.add(".".join(key.split(".")[:2]))


def plain_tables(model: type[Part], data: Mapping[str, Any], folder: Path) -> Spoken:
    """The tables of a case file with every text turned into the number that its key takes.

    `folder` is where files that the case names are looked for.
    """
    spoken = Spoken(folder)
    spoken.data = _table(spoken, model, data, path="")
    for dotted in spoken.bad:  # so that nothing else is said of these keys
        name, _, key = dotted.partition(".")
        table = spoken.data if not key else spoken.data.get(name)
        if isinstance(table, dict):
            table.pop(key or name, None)
    return spoken


def _table(
    spoken: Spoken, model: type[Part], table: Mapping[str, Any], *, path: str
) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in table.items():
        dotted, fields = f"{path}{key}", model.model_fields
        inner = table_of(fields[key].annotation) if key in fields else None
        if inner is not None and isinstance(value, Mapping):
            result[key] = _table(spoken, inner, value, path=f"{dotted}.")
        elif inner is not None and isinstance(value, list) and key == "materials":
            result[key] = [
                _table(spoken, inner, one, path=f"{dotted}.{number}.")
                if isinstance(one, Mapping)
                else one
                for number, one in enumerate(value)
            ]
        elif key in fields:
            result[key] = _percentage(spoken, dotted, key, value)
        elif model is Sizes and key == "file":
            result = {**result, **_curve(spoken, dotted, value, table), **result}
        else:
            more = _with_unit(spoken, model, table, key=key, dotted=dotted)
            result = {**result, **more, **result}
    return result


def _percentage(spoken: Spoken, dotted: str, key: str, value: Any) -> Any:
    """A share as a text with a percent sign; any other value as it is."""
    if not isinstance(value, str) or suffix_of(key) or not value.rstrip().endswith("%"):
        return value
    try:
        return share_of(value)
    except ValueError as error:
        spoken.refuse(dotted, f"{value!r}: {error}")
        return value


def _with_unit(
    spoken: Spoken, model: type[Part], table: Mapping[str, Any], *, key: str, dotted: str
) -> dict[str, Any]:
    """The key with the unit in its name, for one that leaves the unit to its value."""
    meant = [f"{key}{suffix}" for suffix in SUFFIXES if f"{key}{suffix}" in model.model_fields]
    if len(meant) != 1:
        return {key: table[key]}
    target, value = meant[0], table[key]
    texts = list(value) if isinstance(value, list | tuple) else [value]
    if target in table:
        spoken.refuse(dotted, f"given next to {target}, give one of the two")
    elif not all(isinstance(one, str) for one in texts):
        spoken.refuse(
            dotted, f"{value!r} has no unit; write it with its unit, in quotes, or as {target}"
        )
    else:
        try:
            numbers = [converted(one, suffix_of(target)) for one in texts]
            return {target: numbers if isinstance(value, list | tuple) else numbers[0]}
        except ValueError as error:
            spoken.refuse(dotted, f"{value!r}: {error}")
    spoken.bad.add(".".join([*dotted.split(".")[:-1], target][:2]))
    return {}


def _curve(spoken: Spoken, dotted: str, value: Any, table: Mapping[str, Any]) -> dict[str, Any]:
    """The points of the file that a table of sizes names."""
    others = [key for key in table if stem_of(key) in ("size", "passing", "D10", "D50", "D90")]
    if not isinstance(value, str):
        spoken.refuse(dotted, f"{value!r} should be the path of a CSV file, in quotes")
    elif others:
        spoken.refuse(dotted, f"given next to {others[0]}, give one of the two")
    else:
        try:
            size, passing = read_size_file(spoken.folder, value, by=str(table.get("by", "mass")))
            return {"size_mm": size, "passing_percent": passing}
        except ValueError as error:
            spoken.refuse(dotted, str(error))
    return {}


# ---- Case files: a case is read from TOML, and all its problems are named at once.
def case_from(data: Mapping[str, Any], *, source: str = "case", folder: str | Path = ".") -> Case:
    """A case from nested tables; an InvasionCase when there is a table of fines.

    A key of `data` carries its unit, as `radius_mm`, or its value does, `radius = "0.25 mm"`.
    `source` names these tables in messages; files that they name are looked for in `folder`.

    Raises CaseError that lists every problem: dotted key, value given, what is allowed, and for an
    unknown key the nearest known one.

    Examples:
        >>> import fdnet
        >>> tables = fdnet.read_case("cases/quick.toml").data()
        >>> tables["fines"]["radius_mm"] = 0.05
        >>> case = fdnet.case_from(tables)
        >>> isinstance(case, fdnet.InvasionCase), case.fines.radius_mm
        (True, 0.05)
        >>> fdnet.case_from(tables | {"fines": {"radius": 0.05}})
        Traceback (most recent call last):
        ...
        fdnet.errors.CaseError: ...
    """
    model = case_type(data)
    for key in _long_numbers(data):
        raise CaseError(f"{source}: 1 problem: {key}: holds a whole number of more than 18 digits")
    spoken = plain_tables(model, data, Path(folder))
    try:
        case = model.model_validate(spoken.data)
        if not spoken.problems:
            return case
        problems = spoken.problems
    except ValidationError as error:
        problems = [*spoken.problems, *_problems(model, spoken.data, error, spoken.bad)]
    plural = "s" if len(problems) > 1 else ""
    raise CaseError(f"{source}: {len(problems)} problem{plural}: {' | '.join(problems)}")


def sizes_from(table: Mapping[str, Any], *, source: str, folder: Path) -> Sizes:
    """A curve of sizes from the keys of its table; see `case_from`.

    Raises CaseError that lists every problem.
    """
    spoken = plain_tables(Sizes, table, folder)
    problems = list(spoken.problems)
    try:
        if not problems:
            known = Sizes.model_fields
            return Sizes.model_validate({k: v for k, v in spoken.data.items() if k in known})
    except ValidationError as error:
        problems += [_problem(dict(item)).lstrip(": ") for item in error.errors()]
    raise CaseError(f"{source}: the sizes make no curve: {' | '.join(problems)}")


def _long_numbers(value: Any, key: str = "") -> Iterator[str]:
    """Dotted keys of whole numbers that no double or 64-bit number holds."""
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _long_numbers(one, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _long_numbers(one, key)
    elif isinstance(value, int) and abs(value) >= 10**18:
        yield key


def _problems(
    model: type[Case], data: Mapping[str, Any], error: ValidationError, refused: Collection[str]
) -> list[str]:
    """The problems of single keys, then those between the keys that are good.

    Keys that were `refused` before are missing from `data`, of which nothing is said again.
    """
    items = [item for item in error.errors() if item["type"] != "value_error"]
    items = [item for item in items if ".".join(map(str, item["loc"][:2])) not in refused]
    bad = {".".join(map(str, item["loc"][:2])) for item in items} | set(refused)
    tables = {
        name: _good_keys(name, table, info, data, bad)
        for name, info in model.model_fields.items()
        if (table := table_of(info.annotation)) is not None
    }
    return [*dict.fromkeys(_problem(dict(item)) for item in items), *cross_problems(tables, bad)]


def _good_keys(
    name: str, table: type[Part], info: FieldInfo, data: Mapping[str, Any], bad: Collection[str]
) -> Part | None:
    """A table without its bad keys; None where it is missing or cannot do without them."""
    if name not in data:
        return None if info.is_required() else info.default
    if not isinstance(data[name], dict):
        return None
    try:
        return table.model_validate(
            {key: value for key, value in data[name].items() if f"{name}.{key}" not in bad}
        )
    except ValidationError:
        return None


def _problem(item: dict[str, Any]) -> str:
    path = ".".join(
        str(part)
        for part in item["loc"]
        if part not in ("float", "int", "constrained-float") and "[" not in str(part)
    )
    given = item["input"]
    if item["type"] == "extra_forbidden":
        return f"{path}: unknown key (given {given!r}){nearest(path)}"
    if item["type"] == "missing":
        return f"{path}: missing, a value is needed"
    if item["type"] == "size_curve":
        return f"{path}: {item['msg']}"
    message = (
        item["msg"].replace("Input should be", "should be").replace("a valid tuple", "a list")
    )
    key = path.rsplit(".", 1)[-1]
    if isinstance(given, str) and suffix_of(key) and given[:1].isdigit():
        message += f"; a value with its unit goes to {stem_of(key)}"
    return f"{path}: {given!r} {message}"


_LONGEST_WORD = 1000
_MOST_NAMES = 8  # Most parts of a dotted key; no key of a case has so many


def set_keys(data: dict[str, Any], assignments: list[str]) -> dict[str, Any]:
    """`data` with dotted `key=value` assignments put in.

    Values are read as TOML, bare words as text. Raises CaseError for a malformed assignment.
    """
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names) or len(names) > _MOST_NAMES:
            raise CaseError(
                f"--set {assignment[:60]}: expected key=value with a dotted key, "
                "e.g. fines.radius_mm=0.05"
            )
        data = put_keys(data, {key.strip(): _toml_value(text.strip())}, source="--set ")
    return data


def put_keys(
    data: dict[str, Any], values: Mapping[str, Any], *, source: str = ""
) -> dict[str, Any]:
    """`data` with the `values` of dotted keys put in; `source` begins messages.

    The same key with another unit, or without one, goes away. Raises CaseError where a key lies in
    something that is no table.
    """
    result = copy.deepcopy(data)
    for key, value in values.items():
        *names, last = key.split(".")
        table = result
        for name in names:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise CaseError(f"{source}{key} = {value!r}: {name} is a value, not a table")
        for other in [name for name in table if stem_of(name) == stem_of(last)]:
            del table[other]
        table[last] = value
    return result


def _toml_value(text: str) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        table = {"value": text}
        if "\n" in text or len(text) > _LONGEST_WORD:
            table = {}
    if set(table) != {"value"}:
        raise CaseError(f"--set: {text[:60]!r} is not one value; give each key a --set of its own")
    return table["value"]


def read_case(
    path: str | Path,
    *,
    assignments: list[str] | None = None,
    values: Mapping[str, Any] | None = None,
) -> Case:
    """The case in the TOML file at `path`, with dotted `assignments` ("key=value") put in.

    `values` does the same with values by dotted key. Keys are in the unit of their name, such as
    mm or Pa s, or take a text with a unit. Raises CaseError when the file cannot be read, is not
    TOML, or holds an invalid parameter; the message lists every problem.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["analysis.sections=3"])
        >>> case.analysis.sections
        3
    """
    try:
        data = put_keys(set_keys(toml_tables(path), assignments or []), values or {})
        if {"case", "cases"} & data.keys():
            raise CaseError(f"{path}: is a sweep file and no case; fdnet sweep takes it")
        return case_from(data, source=str(path), folder=expanded(path).parent)
    except RecursionError as error:
        raise CaseError(f"{path}: its tables or lists are nested too deeply for a case") from error


def recorded_case(path: Path) -> Case:
    """The case that a run folder holds. Raises CaseError as `read_case` does."""
    return case_from(without_old_keys(toml_tables(path)), source=str(path))


def toml_tables(path: str | Path, what: str = "a case file") -> dict[str, Any]:
    """The tables of a TOML file; `what` names it in messages.

    Raises CaseError where it cannot be read or is no TOML.
    """
    data = file_bytes(path, most=SMALL, what=what)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise CaseError(f"{path}: cannot be read as {what}: {error}; save it as UTF-8") from error
    except RecursionError as error:
        raise CaseError(f"{path}: its tables or lists are nested too deeply") from error
    except ValueError as error:
        raise CaseError(f"{path}: not valid TOML: {error}") from error


# ---- The case files that come with fdnet.
QUICK = "quick-"


class ShippedCase(NamedTuple):
    """A case file that comes with fdnet."""

    name: str  # as `fdnet init --from` takes it; "quick-NAME" is the quick form of NAME
    path: Path  # of the file
    about: str  # the first sentence of its comment


def cases_folder() -> Path:
    """The folder of the shipped cases: in an installed package, or next to an editable one."""
    package = Path(str(files("fdnet")))
    for folder in (package / "cases", package.parent / "cases"):
        if folder.is_dir():
            return folder
    raise CaseError(
        f"{package.parent / 'cases'}: the shipped case files are missing; install fdnet again"
    )


def case_path(name: str) -> Path:
    """The file of a shipped case; "quick-NAME" is the quick form of NAME."""
    stem = name.removeprefix(QUICK)
    return cases_folder() / ("quick" if stem != name else "") / f"{stem}.toml"


def shipped_cases() -> tuple[ShippedCase, ...]:
    """All shipped cases: those that are full first, then the quick forms, by name."""
    folder = cases_folder()
    full = [(path.stem, path) for path in sorted(folder.glob("*.toml"))]
    quick = [(QUICK + path.stem, path) for path in sorted(folder.glob("quick/*.toml"))]
    return tuple(
        ShippedCase(name, path, first_sentence(path.read_text(encoding="utf-8")))
        for name, path in [*full, *quick]
    )


def first_sentence(text: str) -> str:
    """The first sentence of the comment at the top of a file, without its full stop."""
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    joined = " ".join(line.lstrip("# ") for line in comment)
    return re.split(r"[.:](?:\s|$)", joined, maxsplit=1)[0]

"""The mechanics of the pack of a case or of a run: found or packed, solved, and written down."""

import shlex
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from fdnet.case.case import Case
from fdnet.case.file import case_from, read_case, recorded_case, set_keys
from fdnet.errors import CaseError, explained
from fdnet.files import write_text
from fdnet.mechanics import of_case
from fdnet.report.html import put_mechanics
from fdnet.report.tables import plain_json, write_rows
from fdnet.run.dem_stages import packed_grains
from fdnet.run.folder import CASE, is_run_folder, read_record
from fdnet.run.records import RunOptions
from fdnet.spheres.snapshot import Snapshot

FOLDER, NUMBERS, CURVE = "mechanics", "mechanics.json", "stress_strain.csv"
"""Folder of the mechanics in a run folder, the file with its numbers, the curve of a test."""


class Packed(NamedTuple):
    """A case, its grains at rest, and the run folder."""

    case: Case
    grains: Snapshot
    folder: Path


_SPRINGS = ("normal_stiffness_N_m", "shear_stiffness_N_m", "friction", "density_kg_m3")
"""Keys of [grains] that a test may set anew on grains that are packed: no place depends on them
where the grains were packed without friction, as all are."""


def packed_case(source: Path, options: RunOptions, assignments: list[str]) -> Packed:
    """The pack of a case file, made in `options.out` if need be, or that of a run folder.

    Raises CaseError when `source` is neither, or when the `assignments` ("key=value") change the
    pack of a run folder; LiggghtsError when packing fails.
    """
    if source.is_dir():
        folder, file = source, source / CASE
        if not is_run_folder(folder) or not file.is_file():
            raise CaseError(f"{folder}: holds no fdnet run; give a case file or a run folder")
        case = case_from(set_keys(recorded_case(file).data(), assignments), source=str(file))
        if read_record(folder, "pack") is None:
            words = f"{shlex.quote(str(file))} --out {shlex.quote(str(folder))}"
            raise CaseError(
                f"{folder}: holds no finished pack; run the stage pack first (fdnet run {words} "
                "--stages pack --resume)"
            )
    else:
        case = read_case(source, assignments=assignments)
        folder = options.out / case.name if options.out == Path("runs") else options.out
        if read_record(folder, "pack") is None:
            from fdnet.run.pipeline import run_stages

            run_stages(case, replace(options, out=folder, stages=("pack",)))
    recorded, record = recorded_case(folder / CASE).grains, read_record(folder, "pack") or {}
    same = case.grains.model_copy(update={key: getattr(recorded, key) for key in _SPRINGS})
    if record["digest"] != case.model_copy(update={"grains": same}).digest("pack"):
        raise CaseError(
            f"{folder}: its pack belongs to another case; give another --out, or leave out --set "
            "of keys that change the pack"
        )
    return Packed(case, packed_grains(folder, case), folder)


def measure_elastic(packed: Packed, pressure_Pa: float | None) -> dict[str, Any]:
    """Elastic moduli of the pack as keys of mechanics.json, with warnings and seconds."""
    start, case = time.monotonic(), packed.case
    result = of_case.elastic_moduli(packed.grains, case, pressure_Pa=pressure_Pa)
    data = case.data()
    springs = {f"grains.{key}": data["grains"][key] for key in _SPRINGS if key in data["grains"]}
    return {
        "case": case.name,
        "seed": case.seed,
        **of_case.elastic_numbers(result),
        "springs": springs | {f"bonds.{key}": one for key, one in data.get("bonds", {}).items()},
        "warnings": [explained(one) for one in of_case.warnings_of(result, case)],
        "seconds": time.monotonic() - start,
    }


def measure_triaxial(packed: Packed, **test: Any) -> dict[str, Any]:
    """A `triaxial_test` of the pack, as its numbers with warnings and seconds.

    Writes stress_strain.csv and its figure to the folder of the mechanics.
    """
    from fdnet.report.figures import draw_stress_strain

    start = time.monotonic()
    result = of_case.triaxial_test(packed.grains, packed.case, **test)
    numbers = of_case.triaxial_numbers(result)
    numbers["warnings"] = [explained(one) for one in of_case.triaxial_warnings(result)]
    numbers["seconds"] = time.monotonic() - start
    folder = packed.folder / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    rows = [asdict(row) for row in result.rows]
    own = {"axial": "axial_Pa", "side": "side_Pa"}
    own |= {"tension": "broken_in_tension", "shear": "broken_in_shear"}
    write_rows(folder / CURVE, {own.get(k, k): [row[k] for row in rows] for k in rows[0]})
    draw_stress_strain(result.rows, folder / "stress_strain.png", bonds=result.bonds)
    return numbers


def write_mechanics(packed: Packed, numbers: dict[str, Any]) -> Path:
    """Write mechanics.json and, where there is a report, its section; returns the path.

    Where the report has no place for the section, a further warning in `numbers` says so.
    """
    folder = packed.folder / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    path = write_text(folder / NUMBERS, plain_json(numbers)[1] + "\n")
    report = packed.folder / "report.html"
    if report.is_file() and not put_mechanics(report, folder):
        numbers["warnings"].append(f"{report} has no place for the mechanics and stays as it is")
    return path

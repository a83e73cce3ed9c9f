"""`fdnet check`: what is odd about a case is said with what follows and what to do."""

import json
import math
import re
import subprocess
import sys

import pandas as pd
import pytest
from builders import answer, naming, tiny

import fdnet
from fdnet.case.file import case_from
from fdnet.case.tables import AnalysisChoices
from fdnet.cli import main
from fdnet.run.pipeline import with_default_laws
from fdnet.scales.check import PERIODIC, WALLS, WIDTHS, Finding, checked, width_error
from fdnet.scales.scales import scales_of


def found(case: fdnet.Case) -> tuple[Finding, ...]:
    return checked(case, scales_of(case)).findings


def keys(*assignments: str) -> set[str]:
    return {one.key for one in found(tiny(*assignments))}


WELL = ("well.radius_mm=108", "well.drainage_radius_m=100")
BULKY = ("box.size_mm=[3.0,3.0,3.0]", "grains.count=248", "box.sides=periodic")
SOUND = (*WELL, *BULKY, "fines.count=3000")


def test_what_is_odd_is_named_and_nothing_else():
    for odd, key in [
        (("box.size_mm=[3.0,1.6,1.6]", "grains.count=66"), "box.size_mm"),
        (("box.size_mm=[1.4,3.0,3.0]", "grains.count=116", "analysis.sections=1"), "box.size_mm"),
        (("analysis.sections=7",), "analysis.sections"),
        (("fines.count=100",), "fines.count"),
        (("run.cap_ms=2.0",), "run.cap_ms"),
        (("fines.radius_mm=0.12", "fines.count=400"), "fines.radius_mm"),
        (("grains={radius_mm=0.4, porosity=0.38}",), "grains.porosity"),
    ]:
        assert key not in keys(*SOUND)
        assert key in keys(*SOUND, *odd)


def test_one_trouble_is_said_once(root):
    """Without [well], and with a pack that its grains overlap too much for, as it was made."""
    assert sum(" of a well " in one.what for one in found(tiny(*BULKY))) == 1
    for porosity, overlap, refused in ((0.25, "14 %", False), (0.2, "21 %", True)):
        given = [f"grains.porosity={porosity}"]
        (one,) = found(fdnet.read_case(root / "cases" / "quick.toml", assignments=given))
        assert f"overlap by up to some {overlap} of a diameter" in one.what
        assert ("will be refused" in one.what) == refused


def test_a_velocity_of_no_well_and_a_finest_tenth_that_takes_the_time_are_named():
    fast, usual = "fluid.velocity_m_s=10.0", "fluid.velocity_m_s=0.05"
    assert "well" in keys(*BULKY, fast)
    assert "well" not in keys(*BULKY, usual)
    tables = tiny(*SOUND).data()
    for key in ("radius_mm", "count"):
        del tables["fines"][key]
    sizes = {"D10_mm": 0.01, "D50_mm": 0.04, "D90_mm": 0.1}
    tables["fines"] |= {"sizes": sizes, "slab_mm": 3.0}
    assert "fines.cut_um" in {one.key for one in found(case_from(tables))}


def test_the_errors_by_width_are_those_of_the_study(root):
    """The means of `specimen-size.csv` over the seeds of each cube."""
    table = pd.read_csv(root / "docs/evidence/error_against_time/specimen-size.csv")
    table = table[(table.quantity == "k_initial") & table.series.str.startswith("intact")]
    # the cubes have edges in whole quarters of 1 mm
    edge = (table.value.astype(float) * 4 / 3 * math.pi * 0.25**3 / 0.6) ** (1 / 3)
    means = table.groupby(["series", (4 * edge).round() / 4 / 0.5])["observed"].mean()
    bulk = means["intact, periodic sides", 16.0]
    for sides, errors in (("periodic sides", PERIODIC), ("walls at the sides", WALLS)):
        for width, error in zip(WIDTHS, errors, strict=False):
            found = means[f"intact, {sides}", width] / bulk - 1
            assert found == pytest.approx(error, abs=0.002), (sides, width)
    assert width_error(4.8, periodic=False) == pytest.approx(-0.226, abs=0.041)
    assert width_error(5.5, periodic=True) == pytest.approx(-0.0595, abs=0.002)
    assert -0.01 < width_error(100, periodic=True) < 0


def test_the_command_prints_findings_with_what_to_do(tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(tiny(*WELL, "fines.count=100", "run.max_hours=1e-6").toml())
    assert main(["check", str(path)]) == 2
    text = capsys.readouterr().out
    for part in ("fines.count: ", "what follows: ", "what to do: supply", "read: docs/", "time: "):
        assert part in text
    assert "run.max_hours: 1e-06 h" in text
    assert main(["check", str(path), "--json"]) == 2
    data = json.loads(capsys.readouterr().out)
    assert data["findings"][0]["refused"]
    assert all(one["follows"] for one in data["findings"])
    parts = sum(data[f"seconds_{stage}"] for stage in ("pack", "invade", "analyse"))
    assert data["seconds"] == pytest.approx(parts)
    assert main(["render", str(path), "--out", str(tmp_path / "decks")]) == 0
    assert text.strip() in capsys.readouterr().out


def test_check_refuses_what_run_refuses(tmp_path, capsys):
    """Both have one list, so they say the same, too."""
    path, out = tmp_path / "case.toml", tmp_path / "run"
    path.write_text(tiny().toml())
    assert answer(capsys, "check", path)[0] == 0
    for assignments, refused in (
        (("grains.count=3", "run.stiffness_N_m=auto"), "3 grains, expected at least 4"),
        (("clean_up={drawdown_MPa=1000.0}",), "clean_up.drawdown_MPa: 1000"),
        (("fines={radius_mm=0.2, count=200, concentration=0.3}",), "fines without a place"),
        (("grains={radius_mm=0.25, porosity=0.2, max_overlap=0.02}",), "0.2 is out of reach"),
        (("run.max_hours=1e-6",), "run.max_hours"),
        (("fluid.velocity_m_s=5e9",), "drag alone would press"),
    ):
        path.write_text(tiny(*assignments).toml())
        code, *said = answer(capsys, "check", path)
        assert (code, refused in " ".join("".join(said).split())) == (2, True), said
        code, _, error = answer(capsys, "run", path, "--out", out)
        assert (code, refused in error, out.exists()) == (2, True, False), error


def test_what_check_finds_stands_in_summary_and_report(finished):
    """The tiny run is 3.2 grains wide: the study of widths has some 30 % for it."""
    case = fdnet.read_case(finished.path / "case.toml")
    odd = [one.sentence for one in found(case)]
    assert odd[0].startswith("box.size_mm: the specimen is 3.2 mean grains wide")
    assert set(odd) <= set(finished.summary["warnings"])
    report = (finished.path / "report.html").read_text(encoding="utf-8")
    assert "the specimen is 3.2 mean grains wide" in report


STOPPED = """
import ctypes, signal, sys, time
import fdnet.cli, fdnet.commands.run

def check(options):
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))()  # swallows the stop
    if {raises}:
        raise RuntimeError("no compiled object yet")
    time.sleep(20)

signal.signal(signal.SIGINT, signal.default_int_handler)
fdnet.commands.run._check = check
sys.argv = ["fdnet", "check", "case.toml"]
sys.exit(fdnet.cli.main())
"""


def test_a_stop_inside_a_compiler_is_one_line():
    """llvmlite's call-back loses a KeyboardInterrupt, and numba raises another error for it."""
    for raises in (True, False):
        command = [sys.executable, "-c", STOPPED.format(raises=raises)]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=15, check=False)
        assert ended.returncode == 130, raises
        (line,) = ended.stderr.splitlines()
        assert "repeat the command to go on (a run: with --resume)" in line


def test_laws_of_the_thesis_are_said_to_be_wrong_with_the_default_beside(finished, capsys):
    """The second number is what the same spheres give by the default laws in a run of its own."""
    grains, damaged = finished.spheres("initial"), finished.spheres("damaged")
    chosen = AnalysisChoices.of_pack(law="thesis", damage_law="thesis")
    one = with_default_laws(grains, damaged, periodic="yz", options=chosen)
    other = fdnet.analyse(grains, damaged, periodic="yz")
    lost = [float(text) for text in re.findall(r"\((-?[\d.]+) % lost\)", one.warnings[0])]
    assert lost == pytest.approx([100 * x.k_reduction for x in (one, other)], abs=0.051)
    assert abs(lost[1] - lost[0]) > 10
    assert not any("thesis" in text for text in other.warnings)
    spheres = str(finished.path / "spheres_damaged.csv")
    assert main(["permeability", spheres, "--law", "thesis", "--damage-law", "thesis"]) == 0
    assert "warning: the laws thesis and thesis are kept to compare" in capsys.readouterr().out
    assert main(["permeability", spheres]) == 0
    assert "thesis" not in capsys.readouterr().out


NINE_LINES = """
name = "nine"
box.size = ["3 mm", "2 mm", "2 mm"]
grains.sizes = { D10 = "0.25 mm", D50 = "0.40 mm", D90 = "0.60 mm" }
grains.porosity = "38 %"
fines.sizes = { D10 = "70 um", D50 = "90 um", D90 = "115 um" }
fines.concentration = "5 %"
fluid.viscosity = "10 cP"
fluid.overbalance = "300 psi"
well.radius = "108 mm"
"""


def test_nine_lines_and_the_shipped_cases_have_nothing_odd(root, tmp_path):
    """The flow follows the deposit, and no key of forces, contacts or supply is needed."""
    (tmp_path / "nine.toml").write_text(NINE_LINES)
    names = ("quick", "well", "sand-and-mud", "reservoir-sand", "growing-cake")
    for path in (tmp_path / "nine.toml", *(root / "cases" / f"{name}.toml" for name in names)):
        case = fdnet.read_case(path)
        with naming(path):
            assert found(case) == ()
            assert case.drag.coupled
            assert case.fines.endless or path.stem == "growing-cake"

"""`fdnet check`: what is odd about a case is said with what follows and what to do."""

import json

import pytest
from builders import tiny

from fdnet.case.file import case_from
from fdnet.cli import main
from fdnet.scales.check.checked import checked
from fdnet.scales.check.narrow import PERIODIC, WALLS, WIDTHS, width_error
from fdnet.scales.scales import scales_of
from fdnet.scales.times import spoken_memory, spoken_time


def keys(*assignments: str) -> set[str]:
    case = tiny(*assignments)
    return {one.key for one in checked(case, scales_of(case)).findings}


WELL = ("well.radius_mm=108", "well.drainage_radius_m=100")
BULKY = ("box.size_mm=[3.0,3.0,3.0]", "grains.count=248", "box.sides=periodic")
SOUND = (*WELL, *BULKY, "fines.count=3000")


@pytest.mark.parametrize(
    ("odd", "key"),
    [
        (("box.size_mm=[3.0,1.6,1.6]", "grains.count=66"), "box.size_mm"),
        (("analysis.sections=7",), "analysis.sections"),
        (("fines.count=100",), "fines.count"),
        (("run.cap_ms=2.0",), "run.cap_ms"),
        (("fines.radius_mm=0.12", "fines.count=400"), "fines.radius_mm"),
    ],
)
def test_what_is_odd_is_named_and_nothing_else(odd, key):
    assert key not in keys(*SOUND)
    assert key in keys(*SOUND, *odd)


def test_a_velocity_that_no_well_has_is_named():
    fast, usual = "fluid.velocity_m_s=5.0", "fluid.velocity_m_s=0.05"
    assert "well" in keys(*BULKY, fast)
    assert "well" not in keys(*BULKY, usual)


def test_the_errors_by_width_are_those_of_the_study(root):
    """The means of `specimen-size.csv` over the seeds of each cube."""
    import csv

    path = root / "docs/validation/specimen-size.csv"
    rows = [
        row
        for row in csv.DictReader(path.open(encoding="utf-8"))
        if row["quantity"] == "k_initial" and row["series"].startswith("intact")
    ]
    by_width: dict[tuple[str, float], list[float]] = {}
    for row in rows:
        width = float(row["run"].split("size_mm=")[1].split(",")[0]) / 0.5
        by_width.setdefault((row["series"], width), []).append(float(row["observed"]))
    bulk = by_width["intact, periodic sides", 16.0]
    for series, errors in (
        ("intact, periodic sides", PERIODIC),
        ("intact, walls at the sides", WALLS),
    ):
        for width, error in zip(WIDTHS, errors, strict=False):
            got = by_width[series, width]
            assert sum(got) / len(got) / (sum(bulk) / len(bulk)) - 1 == pytest.approx(
                error, abs=0.002
            )


def test_a_wider_specimen_is_nearer_to_the_bulk():
    assert width_error(4.8, periodic=False) == pytest.approx(-0.226, abs=0.041)
    assert width_error(5.5, periodic=True) == pytest.approx(-0.0595, abs=0.002)
    assert -0.01 < width_error(100, periodic=True) < 0


def test_the_command_prints_findings_with_what_to_do(tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(tiny(*WELL, "fines.count=100", "run.max_hours=1e-6").toml())
    assert main(["check", str(path)]) == 0
    text = capsys.readouterr().out
    for part in ("fines.count: ", "what follows: ", "what to do: supply", "read: docs/", "time: "):
        assert part in text
    assert "run.max_hours: 1e-06 h" in text
    assert main(["check", str(path), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["findings"][0]["refused"]
    assert all(one["follows"] for one in data["findings"])
    assert data["seconds"] == pytest.approx(
        data["seconds_pack"] + data["seconds_invade"] + data["seconds_analyse"]
    )
    assert main(["render", str(path), "--out", str(tmp_path / "decks")]) == 0
    assert text.strip() in capsys.readouterr().out


def test_a_range_whose_finest_tenth_takes_the_time_is_named():
    tables = tiny(*SOUND).data()
    for key in ("radius_mm", "count"):
        del tables["fines"][key]
    tables["fines"] |= {
        "sizes": {"D10_mm": 0.01, "D50_mm": 0.04, "D90_mm": 0.1},
        "slab_mm": 3.0,
    }
    case = case_from(tables)
    named = checked(case, scales_of(case)).findings
    assert "fines.cut_um" in {one.key for one in named}


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "1 s"), (62, "62 s"), (110, "2 min"), (7200, "2 h"), (12000, "3 h 20 min"),
     (5e5, "139 h"), (1e9, "2.8e+05 h (32 years)")],
)  # fmt: skip
def test_times_are_said_in_hours_and_minutes(seconds, words):
    assert spoken_time(seconds) == words


def test_memory_is_said_in_megabytes():
    assert (spoken_memory(6.6e8), spoken_memory(2.34e9)) == ("660 MB", "2.3 GB")

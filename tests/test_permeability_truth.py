"""The packs of known permeability (resolved Stokes flow) through the command."""

import csv
import json
from pathlib import Path

import pytest

from fdnet.cli import main
from fdnet.network.conductance import LAWS
from fdnet.network.damage import DAMAGE_LAWS
from fdnet.permeability_command import DAMAGE_LAW_NAMES, LAW_NAMES

DATA = Path(__file__).parent / "data" / "truth"
PACKS = ("packA_200_eps40", "packB_200_eps36", "packC_80_eps40")
LATTICES = {"SC_touching": 0.10, "BCC_touching": 0.10, "FCC_touching": 0.45}
FILLED = ("packC_r10_d2", "packC_r5_d2", "packC_r5_d5", "packC_r5_d8", "packC_r5_half_x", "packC_r5_half_y")


def truth(case: str) -> dict[str, str]:
    with (DATA / "truth.csv").open() as table:
        return next(row for row in csv.DictReader(table) if row["case"] == case and row["file"])


def run(capsys: pytest.CaptureFixture[str], case: str, *more: str) -> dict:
    row = truth(case)
    box = ",".join(["0", row["edge_mm"]] * 3)
    command = ["permeability", str(DATA / row["file"]), "--units", "mm", "--box", box, "--periodic", "xyz"]
    assert main([*command, "--axis", row["axis"], "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("case", PACKS)
def test_random_packs_within_6_percent(capsys, case):
    assert run(capsys, case)["k_initial_m2"] == pytest.approx(float(truth(case)["k_mm2"]) * 1e-6, rel=0.06)


@pytest.mark.parametrize(("case", "within"), LATTICES.items())
def test_lattices(capsys, case, within):
    assert run(capsys, case)["k_initial_m2"] == pytest.approx(float(truth(case)["k_mm2"]) * 1e-6, rel=within)


@pytest.mark.parametrize("case", FILLED)
def test_loss_by_fines_within_15_percent_across_and_along_a_layer(capsys, case):
    found = run(capsys, case)
    assert 1 - found["k_reduction"] == pytest.approx(float(truth(case)["k_over_k0"]), rel=0.15)
    assert found["porosity_damaged"] < found["porosity_initial"]


def test_names_offered_are_the_laws_there_are():
    assert set(LAW_NAMES) == set(LAWS)
    assert set(DAMAGE_LAW_NAMES) == set(DAMAGE_LAWS)


def test_compared_laws_give_what_each_gives_alone(capsys, tmp_path):
    table = tmp_path / "laws.csv"
    found = run(capsys, "packC_r5_d2", "--compare-laws", "--sections", "2", "--csv", str(table))
    pairs = {(one["law"], one["damage_law"]): one for one in found["laws"]}
    assert set(pairs) == {(law, damage) for law in LAWS for damage in DAMAGE_LAWS}
    assert found["k_damaged_m2"] == pairs["series", "kozeny"]["k_damaged_m2"]
    alone = run(capsys, "packC_r5_d2", "--law", "thesis", "--damage-law", "thesis", "--sections", "2")
    both = pairs["thesis", "thesis"]
    for key in ("k_initial_m2", "k_damaged_m2", "sections", "porosity_damaged", "solver", "network_counts", "warnings"):
        assert both[key] == alone[key], key
    with table.open() as rows:
        written = {(row["law"], row["damage_law"]): float(row["k_damaged_m2"]) for row in csv.DictReader(rows)}
    assert written == pytest.approx({pair: one["k_damaged_m2"] for pair, one in pairs.items()}, rel=1e-8)


@pytest.mark.parametrize(("periodic", "axis"), [("xyz", "x"), ("yz", "x"), ("xy", "z"), ("", "y")])
def test_sections_in_place_recombine_in_series(capsys, periodic, axis):
    """L / k = sum of dx / k over the sections, damaged and not, with walls and without."""
    more = ("--sections", "4", "--axis", axis, "--periodic", periodic)
    found = run(capsys, "packC_r5_d2", *more)
    for name in ("initial", "damaged"):
        rows = found["sections"]
        thickness = [row["x_hi_m"] - row["x_lo_m"] for row in rows]
        series = sum(dx / row[f"k_{name}_inplace_m2"] for dx, row in zip(thickness, rows, strict=True))
        assert sum(thickness) / series == pytest.approx(found[f"k_{name}_m2"], rel=1e-9)


def test_sections_are_printed_with_their_units(capsys):
    box = ",".join(["0", truth("packC_r5_d2")["edge_mm"]] * 3)
    assert main(["permeability", str(DATA / "packC_r5_d2.csv"), "--units", "mm", "--box", box, "--sections", "3"]) == 0
    said = capsys.readouterr().out
    assert "from m" in said
    assert len([row for row in said.splitlines() if row.startswith(" ")]) == 4

"""CSV tables and summary.json: contract columns, sums that must come out, no half files."""

import copy
import csv
import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from report_demo import demo_analysis, demo_damaged

from fdnet.files import replacing, write_text
from fdnet.report.tables import (
    section_rows,
    write_pores,
    write_profile,
    write_sections,
    write_summary,
    write_throats,
)
from fdnet.spheres.readers import write_spheres

# DESIGN section 4, word for word
SECTION_COLUMNS = [
    "section",
    "x_lo_m",
    "x_hi_m",
    "porosity_initial",
    "porosity_damaged",
    "k_initial_m2",
    "k_damaged_m2",
    "k_reduction",
    "k_initial_inplace_m2",
    "k_damaged_inplace_m2",
    "fines_count",
    "fines_fraction",
]
PROFILE_COLUMNS = [
    "x_lo_m",
    "x_hi_m",
    "porosity_initial",
    "porosity_damaged",
    "porosity_reduction",
    "fines_fraction",
]


def rows_of(path):
    with path.open(newline="") as handle:
        return list(csv.DictReader(handle))


def changed(analysis, **values):
    return SimpleNamespace(**(vars(analysis) | values))


def test_sections_hold_the_contract_columns_and_count_what_the_sphere_table_says(tmp_path):
    sections = rows_of(write_sections(tmp_path / "sections.csv", demo_analysis()))
    spheres = rows_of(write_spheres(tmp_path / "s.csv", demo_damaged()))
    assert list(sections[0]) == [*SECTION_COLUMNS, "k_initial_mD", "k_damaged_mD"]
    depth = [float(sphere["x_m"]) for sphere in spheres if sphere["kind"] == "fine"]
    for row in sections:
        assert int(row["fines_count"]) == sum(
            float(row["x_lo_m"]) <= x < float(row["x_hi_m"]) for x in depth
        )
    assert sum(float(row["fines_fraction"]) for row in sections) == pytest.approx(1, abs=1e-8)


def test_section_edges_are_written_to_the_last_bit(tmp_path):
    edges = 0.1 + np.arange(3) / 3
    rows = [copy.copy(s) for s in demo_analysis().sections[:2]]
    for row, lo, hi in zip(rows, edges, edges[1:], strict=False):
        row.x_lo, row.x_hi = np.float64(lo), np.float64(hi)
    path = write_sections(
        tmp_path / "sections.csv", changed(demo_analysis(), sections=tuple(rows))
    )
    written = rows_of(path)
    assert [float(row["x_lo_m"]) for row in written] == edges[:2].tolist()
    assert [float(row["x_hi_m"]) for row in written] == edges[1:].tolist()


def test_a_section_without_intact_flow_has_no_reduction(tmp_path):
    dead = copy.copy(demo_analysis().sections[0])
    dead.k_initial, dead.k_damaged, dead.k_reduction = 0.0, 0.0, None
    path = write_sections(tmp_path / "sections.csv", changed(demo_analysis(), sections=(dead,)))
    assert pd.read_csv(path).k_reduction.isna().all()
    assert ",0,0,," in path.read_text()


def test_profile_reduction_is_the_difference_and_shares_sum_to_one(tmp_path):
    profile = pd.read_csv(write_profile(tmp_path / "profile.csv", demo_analysis()))
    assert list(profile.columns) == PROFILE_COLUMNS
    lost = profile.porosity_initial - profile.porosity_damaged
    assert np.allclose(profile.porosity_reduction, lost, rtol=0, atol=2e-9)
    assert np.array_equal(profile.x_lo_m[1:], profile.x_hi_m[:-1])
    assert profile.fines_fraction.sum() == pytest.approx(1, abs=1e-7)


def test_throat_fluxes_in_the_tables_balance_in_every_pore(tmp_path):
    throats = pd.read_csv(write_throats(tmp_path / "throats.csv", demo_analysis()))
    pores = pd.read_csv(write_pores(tmp_path / "pores.csv", demo_analysis()))
    assert (len(throats), len(pores)) == (1722, 894)
    net = np.zeros(len(pores))
    inside = throats[throats.throat_conns_1 >= 0]
    np.add.at(net, throats.throat_conns_0, -throats.flux_damaged_m3)
    np.add.at(net, inside.throat_conns_1, inside.flux_damaged_m3)
    assert np.abs(net).max() < 1e-7 * throats.flux_damaged_m3.abs().max()


@pytest.mark.parametrize("state", ["initial", "damaged"])
def test_throat_flux_follows_from_the_tables_conductance_and_pressures(tmp_path, state):
    throats = pd.read_csv(write_throats(tmp_path / "throats.csv", demo_analysis()))
    pores = pd.read_csv(write_pores(tmp_path / "pores.csv", demo_analysis()))
    beyond = np.append(
        pores[f"pressure_{state}"].to_numpy(), [0.0, 1.0]
    )  # index -1 is the inlet, -2 the outlet
    drop = beyond[throats.throat_conns_0] - beyond[throats.throat_conns_1]
    conductance = throats[f"conductance_{state}_m3"]
    wrong = (throats[f"flux_{state}_m3"] - conductance * drop).abs()
    assert (wrong <= 3e-9 * conductance).all()  # nine digits of two pressures up to 1
    assert np.abs(drop).max() > 0.1


def test_blocked_throats_and_laws_are_told(tmp_path):
    throats = pd.read_csv(write_throats(tmp_path / "throats.csv", demo_analysis()))
    assert throats.blocked.sum() == (throats.law_used == "blocked").sum() > 0
    assert (throats.conductance_damaged_m3[throats.blocked == 1] == 0).all()
    assert (throats.conductance_initial_m3[throats.blocked == 1] > 0).all()


def test_an_intact_pack_has_open_throats_and_the_void_of_its_pores(tmp_path):
    intact = changed(demo_analysis(), occupancy=None)
    throats = pd.read_csv(write_throats(tmp_path / "throats.csv", intact))
    pores = pd.read_csv(write_pores(tmp_path / "pores.csv", intact))
    assert throats.porosity.eq(1).all()
    assert np.allclose(pores.porosity, 0.4)  # of the stand-in: void 0.4 of every tetrahedron
    assert throats.blocked.sum() == throats.fines_count.sum() == 0


def test_summary_takes_numpy_and_names_every_value_json_cannot_hold(tmp_path):
    summary = {
        "k": np.float64(2e-11),
        "n": np.int64(3),
        "flag": np.bool_(True),
        "none": None,
        "path": tmp_path,
        "solver": {"mass_balance": float("nan")},
        "sections": [{"k_reduction": np.inf}],
        "edges": np.array([1.0, 2.0]),
        "warnings": ("doubtful",),
    }
    written = write_summary(tmp_path / "summary.json", summary)
    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert read == written
    assert (read["k"], read["n"], read["flag"], read["none"]) == (2e-11, 3, True, None)
    assert read["edges"] == [1.0, 2.0]
    assert read["solver"]["mass_balance"] is read["sections"][0]["k_reduction"] is None
    assert read["warnings"][0] == "doubtful"
    assert [
        ("solver.mass_balance" in w, "sections[0].k_reduction" in w) for w in read["warnings"][1:]
    ] == [
        (True, False),
        (False, True),
    ]


def test_summary_refuses_what_is_no_data(tmp_path):
    with pytest.raises(TypeError):
        write_summary(tmp_path / "summary.json", {"oops": object()})
    assert list(tmp_path.iterdir()) == []


def test_section_rows_are_what_the_table_says(tmp_path):
    rows = section_rows(demo_analysis())
    table = pd.read_csv(write_sections(tmp_path / "sections.csv", demo_analysis()))
    assert [*rows[0], "k_initial_mD", "k_damaged_mD"] == list(table.columns)
    assert [row["fines_count"] for row in rows] == table.fines_count.tolist()


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = write_text(tmp_path / "a.csv", "old")
    with pytest.raises(ZeroDivisionError), replacing(path) as part:
        part.write_text("half") // 0
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]

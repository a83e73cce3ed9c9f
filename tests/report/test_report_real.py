"""The whole report of a real analysis, and its tables against each other."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from report_demo import BOX, demo_damaged, demo_grains

from fdnet.case.tables import AnalysisChoices
from fdnet.network.permeability import analyse
from fdnet.report import figures, tables, vtk
from fdnet.report.html import ReportParts, write_report
from fdnet.spheres.snapshot import Kind, Snapshot

SIDES = {"walls": (False, False, False), "periodic": (True, True, True)}


@cache
def analysis_of(sides="walls", *, damaged=True, moved=False):
    after = demo_damaged()
    if moved:
        shift = np.where(after.kind == Kind.GRAIN, 2e-6, 0.0)[:, None] * np.array([0.0, 1.0, 0.0])
        after = Snapshot(
            step=1,
            time_s=1.0,
            box=BOX,
            id=after.id,
            kind=after.kind,
            position=after.position + shift,
            radius=after.radius,
            velocity=after.velocity,
        )
    options = AnalysisChoices.of_pack(
        sections=4, law="thesis", damage_law="thesis", profile_bin_mm=0.2
    )
    return analyse(
        demo_grains(), after if damaged else None, periodic=SIDES[sides], options=options
    )


def fines_outside_others(spheres, periodic):
    """The fines that no sphere holds wholly, but for a thousandth of their radius."""
    apart = spheres.position[:, None] - spheres.position
    side = np.ptp(spheres.box, axis=1)
    distance = np.linalg.norm(apart - np.where(periodic, np.rint(apart / side) * side, 0), axis=2)
    inside = distance + 0.999 * spheres.radius[:, None] <= spheres.radius
    np.fill_diagonal(inside, val=False)
    return spheres.where(~inside.any(axis=1) & (spheres.kind == Kind.FINE))


@pytest.mark.parametrize("sides", SIDES)
def test_tables_of_a_real_analysis_agree_with_each_other(tmp_path, sides):
    analysis = analysis_of(sides)
    sections = pd.read_csv(tables.write_sections(tmp_path / "sections.csv", analysis))
    profile = pd.read_csv(tables.write_profile(tmp_path / "profile.csv", analysis))
    pores = pd.read_csv(tables.write_pores(tmp_path / "pores.csv", analysis))
    throats = pd.read_csv(tables.write_throats(tmp_path / "throats.csv", analysis))
    depth = fines_outside_others(demo_damaged(), SIDES[sides]).position[:, 0]
    for row in sections.itertuples():
        assert row.fines_count == ((depth >= row.x_lo_m) & (depth < row.x_hi_m)).sum()
    assert sections.fines_count.sum() == analysis.invaded_count
    assert profile.fines_fraction.sum() == pytest.approx(1, abs=1e-7)
    assert throats.throat_conns_0.max() < len(pores)
    assert throats.blocked.sum() == analysis.occupancy.blocked.sum()


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("state", ["initial", "damaged"])
def test_fluxes_in_paraview_follow_from_pressures_and_conductances(tmp_path, sides, moved, state):
    mesh = pv.read(
        vtk.write_network_vtp(tmp_path / "network.vtp", analysis_of(sides, moved=moved))
    )
    pressure = mesh.point_data[f"pressure_{state}"][mesh.lines.reshape(-1, 3)[:, 1:]]
    flux = mesh.cell_data[f"flux_{state}_m3"]
    connected = np.isfinite(pressure).all(axis=1)
    conductance = mesh.cell_data[f"conductance_{state}_m3"] * mesh.cell_data["throat_share"]
    expected = conductance * (pressure[:, 0] - pressure[:, 1])
    assert connected.mean() > 0.9
    assert np.allclose(
        flux[connected], expected[connected], rtol=0, atol=1e-9 * np.abs(flux).max()
    )


@pytest.mark.parametrize(
    "variant", [{}, {"damaged": False}, {"moved": True}], ids=["fixed", "intact", "moved"]
)
def test_every_door_opens(tmp_path, variant):
    analysis = analysis_of(**variant)
    shown = demo_damaged() if variant.get("damaged", True) else demo_grains()
    for write in (
        tables.write_pores,
        tables.write_throats,
        tables.write_profile,
        tables.write_sections,
    ):
        assert write(tmp_path / f"{write.__name__}.csv", analysis).stat().st_size > 100
    pictures = figures.draw_all(tmp_path / "figures", analysis, shown)
    summary = tables.write_summary(
        tmp_path / "summary.json",
        {
            "case": "real",
            "k_initial_m2": analysis.k_initial,
            "k_damaged_m2": analysis.k_damaged,
            "sections": tables.section_rows(analysis),
            "solver": analysis.solver,
            "network_counts": analysis.counts,
            "seconds": analysis.seconds,
            "warnings": analysis.warnings,
        },
    )
    assert not [line for line in summary["warnings"] if "written as null" in line]
    captioned = [(picture, figures.CAPTIONS[picture.stem]) for picture in pictures]
    page = write_report(tmp_path / "report.html", summary, parts=ReportParts(figures=captioned))
    assert page.read_text(encoding="utf-8").count("data:image/png") == len(pictures)
    network = pv.read(vtk.write_network_vtp(tmp_path / "network.vtp", analysis))
    assert network.n_cells == len(analysis.network.throat_radius)

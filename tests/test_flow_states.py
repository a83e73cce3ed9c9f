"""The flow at the states of a tiny run: fluxes, streamlines, and the command that draws them."""

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from fdnet import solve_flow
from fdnet.cli import main
from fdnet.run.movie import LINES, colour_limits, flux_of, moments_of, streamlines_of

pytestmark = pytest.mark.liggghts


def test_fluxes_are_those_of_the_run_before_and_after(finished):
    """throats.csv holds the fluxes of both states over the same drop of pressure."""
    flow_of, table = flux_of(finished), finished.throats
    first = solve_flow(finished.network(), finished.conductance("initial")).inflow
    for state in ("initial", "damaged"):
        fines = finished.spheres(state).fines()
        expected = 100.0 * np.abs(table[f"flux_{state}_m3"]) / first
        assert flow_of(fines, None).values == pytest.approx(expected, rel=1e-6, abs=1e-9)
    slower = flow_of(finished.spheres("initial").fines(), 0.5)
    assert slower.values == pytest.approx(
        50.0 * np.abs(table["flux_initial_m3"]) / first, rel=1e-6, abs=1e-9
    )
    assert slower.k_over_k0 == pytest.approx(1.0)


def test_streamlines_begin_in_the_mud_and_stay_in_the_box_and_off_the_grains(finished, tmp_path):
    grains = finished.spheres("initial").grains()
    flow = streamlines_of(finished, cells=5)(finished.spheres("initial").fines(), 0.25)
    flow.write(tmp_path / "lines.vtp")
    lines = pv.read(tmp_path / "lines.vtp")
    places, box = np.asarray(lines.points), grains.box
    assert np.all((places[:, 1:] >= box[1:, 0]) & (places[:, 1:] <= box[1:, 1]))
    assert places[:, 0].min() < box[0, 0] - 0.2 * grains.radius.mean()
    ends = np.sum(places[:, 0] >= box[0, 1])
    assert 0.5 * LINES < ends < 1.5 * LINES
    size = np.ptp(box, axis=1)[1:]
    apart = places[:, None] - grains.position[None]
    apart[..., 1:] -= size * np.round(apart[..., 1:] / size)
    # the field keeps its spheres in single precision
    assert np.all(np.linalg.norm(apart, axis=2) > (1.0 - 1e-6) * grains.radius[None])
    speed = np.asarray(lines.point_data["value"])
    upstream = places[:, 0] < box[0, 0] - 0.4 * grains.radius.mean()
    assert np.median(speed[upstream]) == pytest.approx(0.25, rel=0.5), "the rate times 1"


def test_the_command_draws_before_and_after(finished, tmp_path, capsys):
    target = tmp_path / "flux.png"
    assert main(["movie", str(finished.path), "--show", "flux", "--out", str(target)]) == 0
    assert f"picture: {target}" in capsys.readouterr().out
    with Image.open(target) as picture:
        upper, lower = np.array_split(np.asarray(picture.convert("RGB"), float), 2)
    fines = [np.mean(part @ [1.0, 0.0, -1.0] > 150.0) for part in (upper, lower)]
    assert fines[0] < 1e-4 < 1e-3 < fines[1], "the clean sand holds no orange fine"


def test_words_say_what_is_known(finished):
    clean, *_, last = moments_of(finished)
    assert (clean.rate, last.rate) == (None, None), "a uniform flow has no rate of its own"
    assert clean.words() == "clean sand"
    invaded = finished.summary["invaded_count"]
    assert last.words(measured=0.5) == (
        f"{1e3 * finished.summary['physical_time_s']:.3g} ms,   k/k0 0.50,   "
        f"{invaded} fines in the sand"
    )


def test_colours_end_at_the_largest_values():
    assert colour_limits(np.array([0.0, 1e-9, 4.1])) == pytest.approx((0.05, 5.0))

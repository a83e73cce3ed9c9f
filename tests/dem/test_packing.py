"""Packs made by the real binary."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import tiny

from fdnet.dem.deck import specimen_box
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import RestlessError, _creep, check_radii, draw_radii, make_pack
from fdnet.errors import CaseError, DumpError, LiggghtsError
from fdnet.run.records import pack_record, record_warnings
from fdnet.scales.pack import pack_step
from fdnet.scales.scales import packing_scales, scales_of
from fdnet.spheres.snapshot import resting

pytestmark = pytest.mark.liggghts
DENSE = ("box.size_mm=[5.0,3.0,3.0]", "grains={radius_mm=0.25, porosity=0.36}")


def test_porosity_is_met_at_rest_and_a_seed_has_one_pack(binary, tmp_path):
    """Whatever the springs and the ranks of the invasion are."""
    case, soft = tiny(*DENSE), tiny(*DENSE, "run.stiffness_N_m=300.0")
    pack = make_pack(case, tmp_path / "one", Launch(binary=binary))
    again = make_pack(soft, tmp_path / "two", Launch(binary=binary, ranks=2))
    assert soft.digest("pack") == case.digest("pack")
    assert abs(pack.porosity - 0.36) <= 0.003
    assert pack.porosity_error < 0.001
    assert pack.porosity_sum < pack.porosity
    assert np.array_equal(pack.grains.position, again.grains.position)
    per_second = math.sqrt(
        scales_of(case).contacts["grain-grain"].normal_stiffness
        / (2650 * 4 / 3 * math.pi * 0.25e-3**3)
    )
    assert np.max(np.abs(pack.grains.velocity)) < 1e-6 * 0.5e-3 * per_second
    assert np.all((pack.grains.position >= 0) & (pack.grains.position <= case.size_m))


def test_a_pack_that_creeps_is_taken_and_one_that_moves_is_refused(tmp_path):
    """The limit is 1e-5 grain diameters per sqrt(m/k)."""
    case = tiny()
    mass = 2650 * 4 / 3 * math.pi * 0.25e-3**3
    grain = packing_scales(case).contacts["grain-grain"]
    natural, step = 0.5e-3 * math.sqrt(grain.normal_stiffness / mass), pack_step(case, grain)
    still = resting(np.random.default_rng(1).random((50, 3)) * 1e-3, 0.25e-3, specimen_box(case))
    direction = np.random.default_rng(2).normal(size=(50, 3))
    direction /= np.sqrt(np.mean(np.sum(direction**2, axis=1)))
    slow = replace(still, velocity=0.99e-5 * natural * direction)
    assert _creep(case, step, tmp_path, slow) == pytest.approx(0.99e-5 * natural)
    with pytest.raises(
        LiggghtsError, match="did not come to rest in 80000 steps, its grains still move at"
    ):
        _creep(case, step, tmp_path, replace(still, velocity=1.01e-5 * natural * direction))


def test_radii_that_the_case_does_not_ask_for_are_refused(tmp_path):
    """Also where the porosity is the same, and where the radii are those of another seed."""
    case = tiny("grains.radius_mm=[0.15,0.25]", "grains.count=50")
    asked = draw_radii(case, 50)
    grains = resting(np.random.default_rng(1).random((50, 3)) * 1e-3, asked, specimen_box(case))
    check_radii(grains, case, tmp_path)
    one = asked.copy()
    one[7] *= 1 + 1e-8
    for radius in (one, asked[::-1], draw_radii(tiny("seed=2"), 50), np.full(50, 0.2e-3)):
        with pytest.raises(DumpError, match=r"of 50 grains have another radius than the case"):
            check_radii(replace(grains, radius=radius), case, tmp_path)


def test_a_range_of_radii(binary, tmp_path):
    case = tiny("box.size_mm=[5.0,3.0,3.0]", "grains={radius_mm=[0.15,0.25], porosity=0.40}")
    pack = make_pack(case, tmp_path, Launch(binary=binary))
    assert abs(pack.porosity - 0.40) <= 0.003
    assert pack.grains.radius.min() == pytest.approx(0.15e-3, rel=0.02)
    assert pack.grains.radius.max() == pytest.approx(0.25e-3, rel=0.02)


def test_count_overrides_porosity(binary, tmp_path):
    case = tiny("grains={radius_mm=0.25, porosity=0.9, count=66}")
    pack = make_pack(case, tmp_path, Launch(binary=binary))
    assert len(pack.grains) == 66
    assert pack.porosity_sum == pytest.approx(
        1 - 66 * 4 / 3 * math.pi * 0.25**3 / (3.0 * 1.6 * 1.6), rel=1e-9
    )


@pytest.mark.parametrize(
    ("porosity", "message"),
    [
        (0.12, "pushed out of it"),
        (0.27, "0.27 needs .* a porosity of 0.35. at random .*, and about 0.[23]. within"),
    ],
)
def test_unreachable_porosity_is_an_error(binary, tmp_path, porosity, message):
    case = tiny(f"grains={{radius_mm=0.25, porosity={porosity}, max_overlap=0.08}}")
    with pytest.raises(CaseError, match=message):
        make_pack(case, tmp_path, Launch(binary=binary))


def test_a_grain_too_coarse_for_the_tolerance_is_an_error(binary, tmp_path):
    case = tiny("box.size_mm=[1.2,1.2,1.2]", "grains={radius_mm=0.25, porosity=0.47}")
    with pytest.raises(CaseError, match="one grain is"):
        make_pack(case, tmp_path, Launch(binary=binary))


def test_the_overlap_limit_holds_for_a_count_too(binary, tmp_path):
    case = tiny("grains={radius_mm=0.25, count=98}")
    with pytest.raises(
        CaseError,
        match=r"grains\.count: 98 needs (grains that overlap|more room)|98 grains needs more room",
    ):
        make_pack(case, tmp_path, Launch(binary=binary))


def short_relaxation(monkeypatch):
    monkeypatch.setattr("fdnet.dem.packing.REST_RUNS", 1)
    monkeypatch.setattr("fdnet.dem.packing.RELAX_RUN_STEPS", 10)


def test_a_pack_that_never_rests_is_given_up_after_some_places(binary, tmp_path, monkeypatch):
    short_relaxation(monkeypatch)
    monkeypatch.setattr("fdnet.dem.packing.PLACES", 2)
    case = tiny("grains={radius_mm=0.25, count=72}")
    with pytest.raises(RestlessError, match="tried 2 times from other places"):
        make_pack(case, tmp_path, Launch(binary=binary))


def test_a_pack_that_does_not_rest_is_made_again_from_the_next_places(
    binary, tmp_path, monkeypatch
):
    """The first one is called restless; the second starts from other places, the same radii."""
    short_relaxation(monkeypatch)
    judged = []

    def creep(*_):
        judged.append(len(judged))
        if len(judged) == 1:
            raise RestlessError("the first")
        return 1e-9

    monkeypatch.setattr("fdnet.dem.packing._creep", creep)
    case = tiny("grains={radius_mm=[0.2, 0.25], count=72}")
    pack = make_pack(case, tmp_path, Launch(binary=binary))
    assert pack.restless == 1
    assert [row["restless"] for row in pack.attempts] == [1]
    assert judged == [0, 1]
    start = np.loadtxt(tmp_path / "pack.data", skiprows=11)
    drawn = np.random.default_rng([case.seed, 72, 1]).random((72, 3))
    reach = np.array(case.size_m) * drawn
    radius = 0.5 * start[:, 2]
    assert 0.6 * draw_radii(case, 72) == pytest.approx(radius)
    middle = 0.5 * np.array(case.size_m)
    inner = np.abs(reach - middle) < 0.5 * middle
    shift = np.abs(start[:, 4:7] - reach)
    assert np.all(shift[inner] <= radius.max() + 1e-12)
    record = pack_record(case, pack, tmp_path, assumed=0.4, seconds=1.0)
    warnings = record_warnings(case, record, None)
    assert any("1 packs did not come to rest" in one for one in warnings)

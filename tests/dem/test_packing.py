"""Packs made by the real binary."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from builders import tiny

from fdnet.dem.deck import specimen_box
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import RestlessError, check_radii, creep_of, draw_radii, make_pack
from fdnet.errors import CaseError, DumpError, LiggghtsError
from fdnet.run.records import pack_record, record_warnings
from fdnet.scales.pack import pack_step
from fdnet.scales.scales import packing_scales
from fdnet.spheres.snapshot import resting

pytestmark = pytest.mark.liggghts
HERTZ = "contact.model=hertz"


@pytest.fixture(scope="module")
def packed(binary, tmp_path_factory):
    """Pack a case in a folder of its own."""

    def made(*keys: str, ranks: int = 1):
        case, folder = tiny(*keys), tmp_path_factory.mktemp("pack")
        return make_pack(case, folder, Launch(binary=binary, ranks=ranks))

    return made


def natural_speed(case) -> float:
    """One grain diameter per sqrt(m/k), m/s."""
    mass = 2650 * 4 / 3 * math.pi * 0.25e-3**3
    stiffness = packing_scales(case).contacts["grain-grain"].normal_stiffness
    return 0.5e-3 * math.sqrt(stiffness / mass)


def test_porosity_is_met_at_rest_and_a_seed_has_one_pack(packed):
    """Linear and Hertz contacts, one radius and a range; whatever springs and ranks invade it."""
    box = "box.size_mm=[5.0,3.0,3.0]"
    dense, uneven = "radius_mm=0.25, porosity=0.36", "radius_mm=[0.15,0.25], porosity=0.40"
    pack = packed(box, f"grains={{{dense}}}")
    assert pack.porosity_error < 0.001
    assert pack.porosity_sum < pack.porosity
    first, again = packed(), packed("run.stiffness_N_m=300.0", ranks=2)
    assert np.array_equal(first.grains.position, again.grains.position)
    assert tiny().digest("pack") == tiny("run.stiffness_N_m=300.0").digest("pack")
    for grains, porosity, made, case in (
        (dense, 0.36, pack, tiny()),
        (dense, 0.36, packed(box, HERTZ, f"grains={{{dense}}}"), tiny(HERTZ)),
        (uneven, 0.40, packed(box, f"grains={{{uneven}}}"), tiny()),
    ):
        assert abs(made.porosity - porosity) <= 0.003, grains
        assert np.all((made.grains.position >= 0) & (made.grains.position <= [5e-3, 3e-3, 3e-3]))
        if grains == dense:
            assert np.max(np.abs(made.grains.velocity)) < 1e-6 * natural_speed(case)
    assert made.grains.radius.min() == pytest.approx(0.15e-3, rel=0.02)
    assert made.grains.radius.max() == pytest.approx(0.25e-3, rel=0.02)


def test_a_pack_that_creeps_is_taken_and_one_that_moves_is_refused(tmp_path):
    """The limit is 1e-5 grain diameters per sqrt(m/k)."""
    case = tiny()
    step = pack_step(case, packing_scales(case).contacts["grain-grain"])
    natural = natural_speed(case)
    still = resting(np.random.default_rng(1).random((50, 3)) * 1e-3, 0.25e-3, specimen_box(case))
    direction = np.random.default_rng(2).normal(size=(50, 3))
    direction /= np.sqrt(np.mean(np.sum(direction**2, axis=1)))
    speeds = 0.99e-5 * natural, 1.01e-5 * natural
    slow, fast = (replace(still, velocity=speed * direction) for speed in speeds)
    assert creep_of(case, step, tmp_path, slow) == pytest.approx(0.99e-5 * natural)
    with pytest.raises(LiggghtsError, match="did not come to rest in 80000 steps"):
        creep_of(case, step, tmp_path, fast)


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


def test_what_cannot_be_packed_is_an_error_with_what_can(packed):
    small = "box.size_mm=[1.2,1.2,1.2]"
    tight = "0.27 needs .* a porosity of 0.35. at random .*, and about 0.[23]. within"
    many = r"grains\.count: 98 needs (grains that overlap|more room)|98 grains needs"
    for keys, message in (
        (("porosity=0.12, max_overlap=0.08",), "pushed out of it"),
        (("porosity=0.27, max_overlap=0.08",), tight),
        (("porosity=0.47", small), "one grain is"),
        (("count=98",), many),
    ):
        with pytest.raises(CaseError) as error:
            packed(f"grains={{radius_mm=0.25, {keys[0]}}}", *keys[1:])
        assert re.search(message, str(error.value)), keys


def test_a_pack_that_does_not_rest_is_made_again(binary, packed, tmp_path, monkeypatch):
    """The second starts from other places with the same radii; after some it is given up."""
    for name, value in (("REST_RUNS", 1), ("RELAX_RUN_STEPS", 10), ("PLACES", 2)):
        monkeypatch.setattr(f"fdnet.dem.packing.{name}", value)
    with pytest.raises(RestlessError, match="tried 2 times from other places"):
        packed("grains={radius_mm=0.25, count=72}")
    judged = []

    def creep(*_):
        judged.append(len(judged))
        if len(judged) == 1:
            raise RestlessError("the first")
        return 1e-9

    monkeypatch.setattr("fdnet.dem.packing.creep_of", creep)
    case = tiny("grains={radius_mm=[0.2, 0.25], count=72}")
    pack = make_pack(case, tmp_path, Launch(binary=binary))
    assert (pack.restless, judged) == (1, [0, 1])
    assert [row["restless"] for row in pack.attempts] == [1]
    start = np.loadtxt(tmp_path / "pack.data", skiprows=11)
    reach = np.array(case.size_m) * np.random.default_rng([case.seed, 72, 1]).random((72, 3))
    radius, middle = 0.5 * start[:, 2], 0.5 * np.array(case.size_m)
    assert 0.6 * draw_radii(case, 72) == pytest.approx(radius)
    inner = np.abs(reach - middle) < 0.5 * middle
    assert np.all(np.abs(start[:, 4:7] - reach)[inner] <= radius.max() + 1e-12)
    record = pack_record(pack, tmp_path, assumed=0.4)
    warnings = record_warnings(case, record, {})
    assert any("1 packs did not come to rest" in one for one in warnings)

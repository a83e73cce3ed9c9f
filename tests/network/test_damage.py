"""Damage laws on single throats, in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError
from fdnet.network.laws.named import DAMAGE_LAWS, damage_law
from tests.network.networks import chain

R, L = 0.1, 1.0
CLEAN = np.pi * R**4 / (8 * L)


def occupancy(porosity, *, fine=0.02, distance=0.9, blocked=None):
    porosity = np.asarray(porosity, float)
    count = len(porosity)
    return SimpleNamespace(
        throat_porosity=porosity,
        throat_fines=(porosity < 1).astype(int),
        throat_fine_radius=np.full(count, fine),
        blocked=np.zeros(count, bool) if blocked is None else np.asarray(blocked),
        pair_throat=np.arange(count),
        pair_distance=np.full(count, distance),
    )


def damaged(law, state, **options):
    count = len(state.throat_porosity)
    return damage_law(law, **options)(chain(count), state, np.full(count, CLEAN))


def carman_kozeny(porosity, fine):
    k = porosity**3 * (2 * fine) ** 2 / (72 * 2.5 * (1 - porosity) ** 2)
    return k * np.pi * R**2 / L


def test_thesis_law_by_throat_porosity():
    damage = damaged("thesis", occupancy([1.0, 0.8, 0.4, 0.39, 0.2, -0.1]))
    expected = [
        CLEAN,
        CLEAN * 0.64,
        CLEAN * 0.16,
        carman_kozeny(0.39, 0.02),
        carman_kozeny(0.2, 0.02),
        0.0,
    ]
    assert damage.conductance == pytest.approx(expected, rel=1e-12, abs=1e-18)
    assert damage.law_used.tolist() == [
        "clean",
        "deposition",
        "deposition",
        "clogging",
        "clogging",
        "clogging",
    ]
    assert damage.counts["throats_filled"] == 1


def test_thresholds_of_text_and_code_and_by_choice():
    state = occupancy([0.38])
    assert damaged("thesis", state).law_used[0] == "clogging"
    assert damaged("thesis-code", state).law_used[0] == "deposition"
    assert damaged("thesis", state, clogging_threshold=0.3).law_used[0] == "deposition"
    assert damaged("thesis-code", state, clogging_threshold=0.5).law_used[0] == "clogging"


def test_middle_band_is_decided_by_where_the_fines_lie():
    porosity = [0.35, 0.37, 0.79, 0.81]
    wall = damaged("thesis", occupancy(porosity, distance=0.9), middle_band="position")
    middle = damaged("thesis", occupancy(porosity, distance=0.3), middle_band="position")
    assert wall.law_used.tolist() == ["clogging", "deposition", "deposition", "deposition"]
    assert middle.law_used.tolist() == ["clogging", "clogging", "clogging", "deposition"]


def test_blocked_throat_is_closed_whatever_its_porosity():
    damage = damaged("thesis", occupancy([0.9, 0.9], blocked=[True, False]))
    assert damage.conductance == pytest.approx([0.0, CLEAN * 0.81])
    assert damage.law_used[0] == "blocked"


def test_clogging_never_exceeds_the_clean_throat():
    damage = damaged("thesis", occupancy([0.39], fine=1.0))
    assert carman_kozeny(0.39, 1.0) > CLEAN
    assert damage.conductance[0] == CLEAN
    assert damage.counts["capped"] == 1


@pytest.mark.parametrize("options", [{"clogging_threshold": 1.2}, {"middle_band": "guess"}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(CaseError, match=next(iter(options))):
        damaged("thesis", occupancy([0.5]), **options)


def test_an_unknown_law_is_refused_with_the_known_ones():
    with pytest.raises(CaseError, match=r"damage_law: 'guess'.*section-archie.*thesis-code"):
        damage_law("guess")


def test_section_archie_has_no_options():
    archie = damage_law("section-archie", clogging_threshold=0.3)
    assert archie is DAMAGE_LAWS["section-archie"]


@pytest.mark.parametrize(
    ("key", "gone", "instead"),
    [
        ("law", "hydraulic", "lubrication"),
        ("law", "series", "lubrication"),
        ("damage_law", "combined", "auto"),
        ("damage_law", "upscaled", "all-spheres"),
        ("damage_law", "kozeny", "section-archie"),
        ("damage_law", "side-kozeny", "section-archie"),
    ],
)
def test_a_law_that_is_gone_is_refused_with_the_one_to_take(key, gone, instead):
    with pytest.raises(CaseError, match=f"analysis.{key}: .*'{gone}'.*take '{instead}'"):
        AnalysisChoices.of_pack(**{key: gone})

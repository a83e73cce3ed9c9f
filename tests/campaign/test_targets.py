"""Candidate muds against targets: met, open or missed, by their bands."""

import pytest
from campaign.samples import comparison

from fdnet.campaign.result.targets import candidate_lines, candidates, read_targets
from fdnet.errors import CaseError


def test_muds_are_ranked_by_their_bands(tmp_path):
    """Four seeds with s = 0.01: half a band is 3.182 s / 2 = 0.016 about each mean."""
    around = [-0.01, -0.01, 0.01, 0.01]
    values = {
        name: [mean + x * 0.75**0.5 for x in around]
        for name, mean in (("bad", 0.5), ("close", 0.29), ("good", 0.1))
    }
    muds = candidates(comparison(tmp_path, values), read_targets({"k_loss": "30 %"}))
    assert [(m.name, m.state) for m in muds] == [
        ("good", "met"),
        ("close", "open"),
        ("bad", "missed"),
    ]
    # t(n-1) 0.01 / sqrt(n) <= 0.01 first at n = 7: t(6) = 2.447 < 2.646
    assert muds[1].verdicts[0].seeds_needed == 7
    assert "some 7 seeds would decide it" in candidate_lines(muds)[1]


def test_bridging_is_the_share_that_passes(tmp_path):
    more = {"passed_count": [1, 3], "supplied_count": [100, 100]}
    made = comparison(tmp_path, {"mud": [0.1, 0.2]}, more=more)
    (mud,) = candidates(made, read_targets({"bridging": "1 %"}))
    assert mud.verdicts[0].band.mean == pytest.approx(0.02)


def test_targets_carry_units():
    limits = read_targets({"depth": "500 um", "k_loss": "30 %", "bridging": "1 %"})
    assert limits == pytest.approx({"depth": 5e-4, "k_loss": 0.3, "bridging": 0.01})


@pytest.mark.parametrize(
    ("targets", "message"),
    [
        ({}, "missing"),
        ({"cost": 3}, "targets.cost: unknown"),
        ({"depth": "5 kg"}, "targets.depth"),
    ],
)
def test_bad_targets_are_refused(targets, message):
    with pytest.raises(CaseError, match=message):
        read_targets(targets)


def test_the_shipped_design_plans_three_muds_in_eight_packs(root):
    from fdnet.campaign.plan.job import shared_packs
    from fdnet.campaign.plan.sweep import plan_of, read_sweep

    plan = plan_of(read_sweep(root / "cases/sweeps/bridging.toml"))
    diameters = [round(2e6 * v.case.fines.mean_radius_m) for v in plan.variants]
    assert diameters == [30, 60, 100]
    assert (len(plan.jobs), len(shared_packs(plan.jobs))) == (24, 8)

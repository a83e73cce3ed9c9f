"""Sweep files, their plans, and the folder that keeps one plan."""

import pytest
import tomli_w
from builders import TINY, tiny

from fdnet.campaign.plan.ensemble import ensemble_plan
from fdnet.campaign.plan.folder import campaign_folder
from fdnet.campaign.plan.job import shared_packs
from fdnet.campaign.plan.sweep import plan_of, read_sweep
from fdnet.errors import CaseError

GRID = """
case = "tiny.toml"
seeds = [3, 5]
[set]
analysis.sections = 2
[grid]
fines.radius_mm = [0.04, 0.05]
fluid.viscosity = ["10 cP", "50 cP", "90 cP"]
"""


@pytest.fixture
def written(tmp_path):
    """Writes a sweep file with tiny.toml next to it, and reads it."""
    (tmp_path / "tiny.toml").write_text(tomli_w.dumps(TINY))

    def write(text: str):
        path = tmp_path / "sweep.toml"
        path.write_text(text)
        return read_sweep(path)

    return write


def test_a_grid_is_every_combination_with_every_seed(written):
    plan = plan_of(written(GRID))
    assert len(plan.jobs) == len({job.name for job in plan.jobs}) == 12
    cases = {(j.case.fines.radius_mm, j.case.fluid.viscosity_cP, j.seed) for j in plan.jobs}
    assert cases == {(r, v, s) for r in (0.04, 0.05) for v in (10, 50, 90) for s in (3, 5)}
    assert {job.case.analysis.sections for job in plan.jobs} == {2}
    assert plan.keys == ("fines.radius_mm", "fluid.viscosity")


def test_runs_of_one_seed_share_their_pack(written):
    """Fines and fluid are none of a pack's business."""
    plan = plan_of(written(GRID))
    assert {job.seed for job in shared_packs(plan.jobs).values()} == {3, 5}


def test_named_variants_meet_every_case(written, tmp_path):
    (tmp_path / "other.toml").write_text(tomli_w.dumps(TINY | {"name": "other"}))
    plan = plan_of(
        written(
            'cases = ["tiny.toml", "other.toml"]\nseeds = 3\n'
            '[[variants]]\nname = "a/b"\nfines.count = 50\n[[variants]]\n"fines.count" = 60\n'
        )
    )
    assert [one.name for one in plan.variants] == [
        "tiny-a_b",
        "tiny-count=60",
        "other-a_b",
        "other-count=60",
    ]
    assert plan.seeds == (1, 2, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = 2", "case: give one case file"),
        ('case = "tiny.toml"\nsweeps = 1', "sweeps: unknown key"),
        ('case = "tiny.toml"\nname = "a\\ntouch hit"', "name: .*expected letters, digits"),
        *(
            (f'case = "tiny.toml"\nname = {name}', "name: .*expected letters, digits")
            for name in ("'$(touch hit)'", "'a; b'", "'a b'", "''", '"\'"', "5", "'-x'")
        ),
        ('case = "tiny.toml"\n[[variants]]\nname = "a\\nb"', "variants.name: .*one line"),
        ('case = "tiny.toml"\n[[variants]]\nname = []', "variants.name: .*one line"),
        ('case = "tiny.toml"\nseeds = 0', "seeds: 0"),
        ('case = "tiny.toml"\nseeds = [1, 1]', "names a seed twice"),
        ('case = "tiny.toml"\n[grid]\nfines.radius_mm = 0.05', "expected a list of values"),
        ('case = "tiny.toml"\n[grid]\nseed = [1, 2]', "give seeds"),
        ('case = "nowhere.toml"', "cannot be read"),
        ('case = "tiny.toml"\n[grid]\nfines.radus_mm = [1]', "did you mean fines.radius_mm"),
        ('case = "tiny.toml"\n[grid]\nfines.radius_mm = [0.05, -1]', "radius_mm=-1"),
        (
            'case = "tiny.toml"\n[grid]\nfines.count = [1]\n[set]\nfines.count = 2',
            "stands in \\[grid\\] and in set",
        ),
        ("case = ", "not valid TOML"),
    ],
)
def test_bad_sweeps_are_refused(written, text, message):
    with pytest.raises(CaseError, match=message):
        plan_of(written(text))


def test_a_million_runs_are_refused_with_their_number(written):
    values = list(range(1, 1001))
    sweep = written(f'case = "tiny.toml"\nseeds = 1000\n[grid]\nfines.count = {values}')
    with pytest.raises(CaseError, match=r"1,000,000 runs.*--jobs-limit 1000000"):
        plan_of(sweep)


def test_a_folder_keeps_its_plan(tmp_path):
    """More seeds extend it, another case does not fit, and seeds that are there stay."""
    out = tmp_path / "out"
    with campaign_folder(out, ensemble_plan(tiny(), 2)) as plan:
        assert plan.seeds == (1, 2)
        with (
            pytest.raises(CaseError, match="another fdnet is running"),
            campaign_folder(out, plan),
        ):
            pass
    with campaign_folder(out, ensemble_plan(tiny(), 3)) as plan:
        assert plan.seeds == (1, 2, 3)
    with campaign_folder(out, ensemble_plan(tiny(), 1)) as plan:
        assert plan.seeds == (1, 2, 3)
    other = ensemble_plan(tiny("fines.count=299"), 2)
    with pytest.raises(CaseError, match="holds another plan"), campaign_folder(out, other):
        pass
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("mine")
    with (
        pytest.raises(CaseError, match="holds no campaign"),
        campaign_folder(tmp_path / "mine", other),
    ):
        pass

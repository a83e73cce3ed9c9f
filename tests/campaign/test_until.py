"""Seeds are added until a band is narrow, with runs that answer at once."""

import pytest
from builders import tiny
from campaign.samples import finished_run

from fdnet.campaign import campaign
from fdnet.campaign.campaign import Goal, carry_out
from fdnet.campaign.engine.tasks import HowToRun
from fdnet.campaign.plan.ensemble import ensemble_plan
from fdnet.campaign.until import parse_until
from fdnet.case.file import read_case
from fdnet.errors import CaseError

VALUES = [0.30, 0.40, 0.50, 0.38, 0.42, 0.40, 0.41, 0.39, 0.40, 0.40]


@pytest.fixture
def answers(monkeypatch):
    """Every run ends at once; its loss of permeability is that of VALUES by its seed."""

    def finish(path, tasks, *, jobs, ended):
        for task in (task for task in tasks if not task.name.startswith("pack-")):
            case = read_case(path / "cases" / f"{task.name}.toml")
            finished_run(path / "runs" / task.name, case, k_reduction=VALUES[case.seed - 1])
            ended(task.name, 0)

    monkeypatch.setattr(campaign, "run_local", finish)


def carried_out(path, goal, *, most):
    return carry_out(
        path,
        ensemble_plan(tiny(), 3),
        HowToRun(jobs=1, quiet=True),
        Goal(until=parse_until(goal), most_seeds=most),
    )


def test_seeds_are_added_until_the_band_is_narrow(tmp_path, answers):
    """Half bands of the first 3 and 6 values are 0.248 and t(5) sqrt(0.00416 / 6) = 0.0677."""
    made = carried_out(tmp_path / "a", "k_reduction ± 10 %", most=20)
    assert len(made.done) == 6
    assert made.band("tiny", "k_reduction").half_width == pytest.approx(
        2.570582 * (0.00416 / 6) ** 0.5
    )


def test_the_budget_of_seeds_ends_it(tmp_path, answers):
    made = carried_out(tmp_path / "a", "k_reduction ± 0.001 %", most=8)
    assert len(made.done) == 8


def test_a_goal_of_a_number_that_no_summary_has_is_refused(tmp_path, answers):
    with pytest.raises(CaseError, match="did you mean k_reduction"):
        carried_out(tmp_path / "a", "k_reduce ± 5 %", most=8)

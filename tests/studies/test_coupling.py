"""A study makes a run once: `run_case` opens it again and refuses one of another case."""

from functools import partial

import pytest

from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.run.pipeline import run_case


def test_a_finished_run_is_read_and_one_of_another_case_refused(finished):
    again = partial(run_case, stages=("pack", "invade", "analyse"), resume=True, progress=False)
    before = sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*"))
    assert again(finished.case, finished.path).summary == finished.summary
    data = finished.case.data()
    data["seed"] += 1
    with pytest.raises(CaseError, match="holds a run of another case"):
        again(case_from(data), finished.path)
    assert sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*")) == before

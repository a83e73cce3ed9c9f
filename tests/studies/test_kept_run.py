"""Runs that a study makes once: a folder of another case is refused."""

import pytest

from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.studies.dem.kept_run import kept_run


def test_a_finished_run_is_read_and_one_of_another_case_refused(finished):
    before = sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*"))
    assert kept_run(finished.case, finished.path).summary == finished.summary
    data = finished.case.data()
    data["seed"] += 1
    with pytest.raises(CaseError, match="holds a finished run of another case"):
        kept_run(case_from(data), finished.path)
    assert sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*")) == before

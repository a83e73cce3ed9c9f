"""Side walls of the analysis count in the digest of a stage whose fluid is made with them."""

import pytest
from builders import tiny

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.run.folder import RunFolder, open_folder

NETWORK = ("drag.field=network", "drag.upstream=darcy", "drag.scheme=implicit")
LIFTED = ("clean_up.drawdown_MPa=1.0",)
RECORD = {
    "format": 1,
    "ranks": 1,
    "files": {"post/gone.dump": "0" * 64},
    "seconds": 1.0,
    "max_overlap": 0.0,
    "steps": 1,
    "dt_s": 1e-7,
    "runs": [{"version": "3.8.0", "seconds": 1.0}],
    "left_out": [],
    "porosity": 0.4,
    "porosity_assumed": 0.4,
    "attempts": [{"liggghts_s": 1.0}],
    "stop_reason": "cap",
    "physical_time_s": 1.0,
    "supplied": 1,
    "warnings": [],
}
"""A record of any stage, but for its digest."""
PERIODIC = ("box.sides=periodic",)


def changed(*keys: str) -> set[str]:
    """The stages whose digest is another one where the walls slip."""
    held, slip = tiny(*keys), tiny(*keys, "analysis.walls=slip")
    return {
        stage
        for stage in ("pack", "invade", "clean_up", "analyse")
        if held.digest(stage) != slip.digest(stage)
    }


@pytest.mark.parametrize(
    ("keys", "stages"),
    [
        (NETWORK, {"invade", "clean_up"}),
        ((*NETWORK, *LIFTED, "run.stiffness_N_m=auto"), {"invade", "clean_up"}),
        (LIFTED, set()),
        ((), set()),
        ((*NETWORK, *PERIODIC), set()),
    ],
)
def test_walls_count_where_the_fluid_is_made_with_them(keys, stages):
    """The analysis itself always depends on them; a pack never does."""
    assert changed(*keys) == {*stages, "analyse"}


def with_stages(case: Case, path, *stages: str) -> RunFolder:
    """A run folder in which `stages` are done, by their records."""
    folder = open_folder(path, case, stages=stages, resume=False, force=False)
    for stage in stages:
        (path / stage).mkdir()
        folder.finish(stage, RECORD | {"digest": case.digest(stage)})
    folder.complete(None)
    folder.close()
    return folder


@pytest.mark.parametrize("keys", [NETWORK, (*NETWORK, *LIFTED)])
def test_force_keeps_no_invasion_made_with_other_walls(keys, tmp_path):
    case, path = tiny(*keys), tmp_path / "run"
    with_stages(case, path, "pack", "invade")
    later = tuple(stage for stage in case.stages if stage not in ("pack", "invade"))
    slip = tiny(*keys, "analysis.walls=slip")
    with pytest.raises(CaseError, match="invade: belongs to another case; add invade"):
        open_folder(path, slip, stages=later, resume=False, force=True)
    open_folder(path, case, stages=later, resume=False, force=True).close()

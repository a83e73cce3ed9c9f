"""A study that is stopped or killed takes all its processes with it, and goes on when repeated."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

import pytest

from validation.thesis.runs import carry_out as runs
from validation.thesis.runs.plan import Planned
from validation.thesis.runs.state import read_state

pytestmark = pytest.mark.liggghts
MARK = "FDNET_TEST_MARK"
WITHIN_S = 10.0
"""Seconds after the signal within which no process of the study is left.

On idle cores that takes a second or two; a machine with a load of 15 on two cores took over three.
"""
SMALL = ("box.size_mm=[2.0,1.2,1.2]", "grains.count=26", "fines.count=60", "run.cap_ms=0.1")


def alive(mark: str) -> list[str]:
    """Command lines of the processes that inherited `mark` and have not ended."""
    lines = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes():
                command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                lines += [f"{folder.name} {command}"] if command else []
        except OSError:
            continue
    return lines


def stop(command: list[str], ready: Callable[[], bool], sign: int, **given) -> tuple[int, str]:
    """Send `sign` to the command's own process when `ready`; its exit code and what is left."""
    mark = uuid4().hex
    process = subprocess.Popen(
        command,
        env=os.environ | {MARK: mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **given,
    )
    deadline = time.monotonic() + 60
    while process.poll() is None and not ready() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert process.poll() is None, process.communicate()[1]
    assert ready()
    process.send_signal(sign)
    deadline = time.monotonic() + WITHIN_S
    while alive(mark) and time.monotonic() < deadline:
        process.poll()
        time.sleep(0.02)
    left = alive(mark)
    for line in left:
        os.kill(int(line.split()[0]), signal.SIGKILL)
    assert not left, left
    return process.wait(1), process.stderr.read() if process.stderr else ""


@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_stopped_study_of_the_thesis_leaves_no_process(tmp_path, sign):
    folders = tmp_path / "runs"
    command = ["study", "thesis", "--quick", "--jobs", "2"]
    code, screen = stop(
        [sys.executable, "-m", "fdnet.cli", *command, "--out", "out", "--runs", "runs"],
        lambda: bool(list(folders.glob("*/pack/attempt_1/screen.txt"))),
        sign,
        cwd=tmp_path,
    )
    assert code == (130 if sign != signal.SIGKILL else -signal.SIGKILL)
    assert "Traceback" not in screen
    if sign != signal.SIGKILL:
        assert "repeat the command to go on" in screen
    begun = sorted(path.name for path in folders.iterdir())
    time.sleep(0.5)
    assert sorted(path.name for path in folders.iterdir()) == begun
    assert len(begun) <= 2
    assert all(read_state(path) for path in (tmp_path / "out").rglob("*.npz"))


def test_a_stopped_study_goes_on_where_it_was(tmp_path):
    """The states are those of a study that nobody stopped."""
    plan = [
        Planned(case="quick-specimen5", group="quick", seed=seed, settings=SMALL)
        for seed in (1, 2)
    ]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    driver = (
        "from pathlib import Path\n"
        "from validation.thesis.runs.carry_out import carry_out\n"
        "from validation.thesis.runs.plan import Planned\n"
        f"plan = [Planned(case='quick-specimen5', group='quick', seed=s, settings={SMALL})"
        " for s in (1, 2)]\n"
        "if __name__ == '__main__':\n"
        f"    out = Path({str(cut)!r})\n"
        "    carry_out(plan, out, out / 'runs', jobs=1, report=print)\n"
    )
    (tmp_path / "driver.py").write_text(driver)
    stop(
        [sys.executable, str(tmp_path / "driver.py")],
        lambda: bool(list(cut.glob("runs/*/pack/attempt_1/screen.txt"))),
        signal.SIGKILL,
    )
    for out in (cut, whole):
        assert runs.carry_out(plan, out, out / "runs", jobs=1, report=print) == {}
    for item in plan:
        one, other = (runs.state_path(out, item) for out in (cut, whole))
        assert read_state(one).damaged.position.tobytes() == (
            read_state(other).damaged.position.tobytes()
        )

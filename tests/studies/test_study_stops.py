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

pytestmark = pytest.mark.liggghts
MARK = "FDNET_TEST_MARK"
WITHIN_S = 10.0
"""Seconds after the signal within which no process of the study is left.

On idle cores that takes a second or two; a machine with a load of 15 on two cores took over three.
"""


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
def test_a_stopped_study_of_a_choice_leaves_no_process(root, tmp_path, sign):
    """Also while a point computes in a process of its own that hears no signal at once."""
    (tmp_path / "driver.py").write_text(
        "import sys\n"
        f"sys.path[:0] = [{str(root / 'tests')!r}, {str(root)!r}]\n"
        "from pathlib import Path\n"
        "import toy_points\n"
        "from validation.engine.runner import run_points\n"
        "if __name__ == '__main__':\n"
        "    run_points(toy_points.endless(), Path('out'), quick=False)\n"
    )
    (tmp_path / "toy_points.py").write_text(
        "from studies.toy_study import toy\n"
        "def measure(point, work):\n"
        "    (work / 'begun').touch()\n"
        "    while True:\n"
        "        pass\n"
        "def endless():\n"
        "    return toy(measure=measure, isolated=True, seconds=1e3)\n"
    )
    code, _ = stop(
        [sys.executable, "driver.py"],
        lambda: (tmp_path / "out" / "work" / "begun").exists(),
        sign,
        cwd=tmp_path,
    )
    assert code != 0

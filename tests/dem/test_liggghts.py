"""All kinds of failure of a run of LIGGGHTS, played by a fake of ten lines."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fdnet.dem import liggghts as process
from fdnet.dem.liggghts import Binary, Launch, find_binary, run_deck
from fdnet.errors import LiggghtsError

FAKE = """#!/bin/sh
case "$1" in -h) echo "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled)"; exit 0;; esac
mode=$(cat mode)
echo "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"
case "$mode" in
ok) echo "   100   20   1.5   0.2"; echo DECK_DONE;;
exit1) echo "ERROR: Unknown command: nonsense (input.cpp:271)"; exit 1;;
error0) echo "ERROR on proc 0: Cannot open file"; echo DECK_DONE;;
short) echo "half way";;
silent) exit 1;;
lost) echo "ERROR: Lost atoms: original 20 current 19"; exit 1;;
nan) echo "   100   20   nan   0.2"; echo DECK_DONE;;
forced) echo "Forced restart written"; echo DECK_DONE;;
segv) kill -SEGV $$;;
junk) printf '\\377\\376 junk\\n'; echo DECK_DONE;;
hang) echo started; sleep 60;;
slowly) printf "one line "; sleep 0.3; printf "in two parts\\n   100   20   1.5\\nDECK_DONE";;
flood) while :; do echo "a line that comes again and again, for ever and ever"; done;;
zeros) exec cat /dev/zero;;
log) exec cat /dev/zero > log.liggghts;;
esac
"""


@pytest.fixture
def fake(tmp_path: Path) -> Binary:
    path = tmp_path / "bin" / "liggghts"
    path.parent.mkdir()
    path.write_text(FAKE)
    path.chmod(0o755)
    (tmp_path / "in.deck").write_text("units si\n")
    return find_binary(str(path))


def run(fake: Binary, folder: Path, mode: str, **options):
    (folder / "mode").write_text(mode)
    return run_deck(folder, "in.deck", Launch(binary=fake, **options))


def test_a_whole_run_is_a_run_and_its_lines_are_followed_whole(fake, tmp_path):
    lines: list[str] = []
    assert run(fake, tmp_path, "ok", follow=lines.append).version == "3.8.0"
    assert lines[-1] == "DECK_DONE"
    assert run(fake, tmp_path, "junk").ranks == 1
    run(fake, tmp_path, "slowly", follow=lines.append)
    assert lines[-3:] == ["one line in two parts", "   100   20   1.5", "DECK_DONE"]


def test_what_is_printed_while_the_end_is_looked_for_is_read(fake, tmp_path, monkeypatch):
    late = process.Feed._ended
    monkeypatch.setattr(process.Feed, "_ended", lambda feed: time.sleep(0.5) or late(feed))
    monkeypatch.setattr(process, "_PATIENCE", 0.05)
    run(fake, tmp_path, "slowly", follow=(lines := list[str]()).append)
    assert lines[-1] == "DECK_DONE"


def test_failures_are_reported_with_their_evidence(fake, tmp_path):
    for mode, message in {
        "exit1": r"exit 1\): ERROR: Unknown command: nonsense",
        "error0": r"exit 0\): ERROR on proc 0: Cannot open file",
        "short": r"exit 0, no DECK_DONE line\): the last line is 'half way'",
        "silent": r"exit 1, no DECK_DONE line",
        "lost": "Lost atoms",
        "nan": "not-a-number in the output",
        "forced": "Forced restart written",
        "segv": "signal 11",
    }.items():
        with pytest.raises(LiggghtsError) as error:
            run(fake, tmp_path, mode)
        assert re.search(message, str(error.value)), mode


def test_a_run_is_stopped_at_its_time_limit(fake, tmp_path):
    """Whether it hangs or its screen grows; the clock is looked at meanwhile."""
    for mode, follow in (("hang", None), ("flood", lambda line: time.sleep(0.01))):
        start = time.monotonic()
        with pytest.raises(LiggghtsError, match="did not end within its time limit"):
            run(fake, tmp_path, mode, deadline=time.monotonic() + 0.5, follow=follow)
        assert time.monotonic() - start < 10, mode


def test_the_run_dies_with_its_parent(fake, tmp_path):
    """kill -9 of Python must not leave an orphan that writes into a resumed run."""
    (tmp_path / "mode").write_text("hang")
    code = "from pathlib import Path\nfrom fdnet.dem.liggghts import *\n"
    code += f"launch = Launch(binary=find_binary({str(fake.path)!r}))\n"
    code += f"run_deck(Path({str(tmp_path)!r}), 'in.deck', launch)"
    parent = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    screen = tmp_path / "screen.txt"
    until(lambda: screen.exists() and "started" in screen.read_text())
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
    assert children
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    until(lambda: not any(map(_alive, children)))
    assert not any(map(_alive, children))


def test_a_folder_where_liggghts_still_writes_is_refused(fake, tmp_path, monkeypatch):
    """LIGGGHTS holds the lock itself: it outlives a killed parent; MPI ranks take time to end."""
    monkeypatch.setattr(process, "LOCK_PATIENCE", 0.3)
    command = ["sh", "-c", f"exec 9>{tmp_path}/.lock; flock 9; sleep 30 9>&9"]
    orphan = subprocess.Popen(command, start_new_session=True)
    time.sleep(0.5)
    with pytest.raises(LiggghtsError, match="still writing here"):
        run(fake, tmp_path, "ok")
    os.killpg(orphan.pid, signal.SIGKILL)
    orphan.wait()
    assert run(fake, tmp_path, "ok").ranks == 1


def until(done) -> None:
    """Wait until that is so, for at most 30 s."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and not done():
        time.sleep(0.05)


def _alive(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_missing_binary_deck_and_strangers(fake, tmp_path, monkeypatch):
    with pytest.raises(LiggghtsError, match="LIGGGHTS not found"):
        find_binary(str(tmp_path / "nowhere"))
    with pytest.raises(LiggghtsError, match="does not answer like LIGGGHTS"):
        find_binary("/bin/true")
    with pytest.raises(LiggghtsError, match="deck not found"):
        run_deck(tmp_path, "in.other", Launch(binary=fake))
    monkeypatch.setenv("FDNET_LIGGGHTS", str(fake.path))
    assert find_binary().path == fake.path
    with pytest.raises(LiggghtsError, match="no mpirun"):
        Binary(path=fake.path, version="3.8.0", launcher=None).command("in.deck", 2)


@pytest.mark.liggghts
def test_the_real_binary_fails_as_the_fake_does(binary, tmp_path):
    for text, message in (
        ("nonsense\n", "Unknown command"),
        ("units si\nread_data none.data\n", "Cannot open file"),
        ("units si\n", "no DECK_DONE"),
        ('print "${undefined}"\n', "exit 1"),
        ("quit\n", "exit 1"),
    ):
        (tmp_path / "in.bad").write_text(text)
        with pytest.raises(LiggghtsError, match=message):
            run_deck(tmp_path, "in.bad", Launch(binary=binary))
    if (os.cpu_count() or 1) > 1 and binary.launcher is not None:
        (tmp_path / "in.two").write_text('units si\nprint "DECK_DONE"\n')
        assert run_deck(tmp_path, "in.two", Launch(binary=binary, ranks=2)).ranks == 2


def test_a_run_that_floods_its_screen_or_log_is_stopped(fake, tmp_path, monkeypatch):
    monkeypatch.setattr("fdnet.dem.liggghts.MOST_BYTES", 1 << 20)
    for mode in ("flood", "zeros", "log"):
        with pytest.raises(LiggghtsError, match=r"LIGGGHTS wrote more than 1 MiB into .*; "):
            run(fake, tmp_path, mode, deadline=time.monotonic() + 60.0)

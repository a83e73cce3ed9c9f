"""Progress shows the step, the invaded count and the time left."""

from fdnet.run.progress import Progress


def test_lines_of_a_run_become_progress(capsys, monkeypatch):
    clock = iter(range(0, 1000, 6))
    monkeypatch.setattr("fdnet.run.progress.time.monotonic", lambda: float(next(clock)))
    with Progress("invade", 1000) as progress:
        progress("      100     1369   1.5e-07     0.21")
        progress("noise 1 2 3")
        progress("FDNET checkpoint 1 300 10 20 3")
    shown = capsys.readouterr().err
    assert "step 300 of ~1000" in shown
    assert "invaded 20" in shown
    assert "left" in shown


def test_quiet_says_nothing(capsys):
    with Progress("pack", 10, show=False) as progress:
        progress("FDNET grown 1 30")
    assert capsys.readouterr().err == ""

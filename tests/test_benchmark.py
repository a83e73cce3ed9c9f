"""The benchmark: its spheres, a run that ends and one that does not, and a whole run's cost."""

from validation.benchmark import ROOT, measured


def test_how_a_process_ended_is_a_row(tmp_path):
    [failed] = measured(["fdnet", str(tmp_path / "none.npz"), ""], ROOT, 60)
    assert failed["status"].startswith("exit 1: FileNotFoundError")
    [late] = measured(["fdnet", str(tmp_path / "none.npz"), ""], ROOT, 0.01)
    assert late["status"] == "stopped after 0.01 s"

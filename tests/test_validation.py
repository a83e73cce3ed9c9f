"""The judge of the studies: errors and bands by hand, the kept tables, points, runs, refusals."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student

import fdnet
from fdnet.errors import CaseError, FlowError
from validation import judge, study
from validation.judge import DONE, Level, Rule

KEPT = study.KEPT


def rows(*lines: tuple) -> pd.DataFrame:
    """A table of (series, value, seed, observed) of the quantity q."""
    names = ("series", "value", "seed", "observed")
    same = {"knob": "k", "quantity": "q", "core_s": 1.0, "status": DONE}
    return judge.rows_from([dict(zip(names, line, strict=True)) | same for line in lines])


def by_value(table: pd.DataFrame, quantity: str = "q") -> dict[str, Level]:
    return {level.value: level for level in judge.levels(table, "s", quantity)}


def test_the_kept_tables_have_their_errors_and_bands_from_what_was_observed():
    """The columns were written by the engine before this one, from all digits."""
    for name in study.NAMES:
        old = judge.read_rows(KEPT / f"{name}.csv")
        new = study.kept_rows(name)
        keys = ["series", "value", "seed", "quantity"]
        both = old.merge(new, on=keys, how="outer", suffixes=("", "_new"), validate="1:1")
        assert len(both) == len(old) == len(new), name
        error, band = (both[f"{column}_new"].to_numpy() for column in ("error", "band"))
        # nine digits of a value are 1e-8 of an error, and of two seeds 13 times that in its band
        assert error == pytest.approx(both.error.to_numpy(), rel=1e-8, abs=1e-8, nan_ok=True)
        assert band == pytest.approx(both.band.to_numpy(), rel=2e-7, abs=2e-7, nan_ok=True)
        assert (both.error.notna() == both.band.notna()).all(), name


def test_paired_errors_are_taken_seed_by_seed_over_the_mean():
    """The seed adds 10 or 20, the setting 1: the scatter of seeds cancels."""
    table = rows(
        ("s", "good", "1", 10.0), ("s", "good", "2", 20.0),
        ("s", "poor", "1", 11.0), ("s", "poor", "2", 21.2), ("s", "poor", "3", 16.0),
    )  # fmt: skip
    judged = judge.judged(table, [Rule(["q"], "paired", reference=["none", "good"])])
    errors = [-5 / 15, 5 / 15, 1 / 15, 1.2 / 15, 1 / 15]
    assert judged.error.tolist() == pytest.approx(errors)
    half = student.ppf(0.975, 2) * np.std(errors[2:], ddof=1) / math.sqrt(3)
    assert by_value(judged)["poor"].band == pytest.approx(half)
    assert by_value(judged)["good"].error == 0.0


def test_unpaired_errors_carry_the_band_of_their_reference():
    """Both means are of one distribution: their difference's band holds 0, 95 of 100 times."""
    rng, outside = np.random.default_rng(5), 0
    rule = Rule(["q"], "unpaired", reference=["good"], size="one run's {}")
    for _ in range(50):
        poor, good = rng.normal(1.0, 0.1, 10), rng.normal(1.0, 0.1, 5)
        lines = [("s", "poor", str(n), value) for n, value in enumerate(poor)]
        lines += [("s", "good", str(100 + n), value) for n, value in enumerate(good)]
        judged = judge.judged(rows(*lines), [rule])
        outside += by_value(judged)["poor"].resolved
        one = by_value(judged, "one run's q")["poor"]
        assert one.error == pytest.approx(np.mean(np.abs(poor / good.mean() - 1.0)))
    assert outside < 6


def test_each_sample_has_its_own_truth_with_its_own_uncertainty():
    table = rows(
        ("truth", "known", "A", 2.0), ("truth", "known", "B", 10.0),
        ("s", "law", "A", 2.2), ("s", "law", "B", 9.0), ("s", "grid", "A", 3.0),
    )  # fmt: skip
    table.loc[table.value == "known", "sd"] = [0.1, 0.0]
    judged = judge.judged(table, [Rule(["q"], "each", reference=["known"])])
    assert judged.error.tolist() == pytest.approx([np.nan, np.nan, 0.1, -0.1, 0.5], nan_ok=True)
    assert by_value(judged)["grid"].band == pytest.approx(1.96 * 0.05)


def test_what_is_an_error_already_stays_and_shares_have_wilson_s_band():
    table = rows(("s", "a", "1", -0.2), ("s", "b", "1", 0.0))
    assert judge.judged(table, [Rule(["q"], "error")]).error.tolist() == [-0.2, 0.0]
    assert judge.judged(table, [Rule(["q"], "size")]).error.tolist() == [0.2, 0.0]
    judged = judge.judged(table.assign(observed=[0.2, 0.0]), [Rule(["q"], "size", trials=60)])
    square = 1.96**2
    assert judged.band.iloc[1] == pytest.approx(square / (60 + square) / 2, rel=1e-3)


def test_what_cannot_be_judged_is_refused_with_its_reason(tmp_path):
    table = rows(("s", "good", "1", 1.0), ("s", "poor", "1", 2.0))
    table.loc[0, ["status", "observed"]] = ["failed: no LIGGGHTS", np.nan]
    with pytest.raises(CaseError, match=r"no run of the reference .* \(failed: no LIGGGHTS\)"):
        judge.judged(table, [Rule(["q"], "paired", reference=["good"])])
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(CaseError, match="has the columns"):
        judge.read_rows(tmp_path / "other.csv")
    with pytest.raises(CaseError, match="is not known, expected one of drag"):
        study.read_study("nothing")
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(CaseError, match="holds no study"):
        study.run_study(study.read_study("velocity-field", quick=True), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.csv", "precious.txt"]


def test_every_study_has_points_or_cases_that_can_be_read_once_each():
    for name in study.NAMES:
        for quick in (True, False):
            one = study.read_study(name, quick=quick)
            points = study.points_of(one)
            keys = [json.dumps(point) for point in points]
            assert len(set(keys)) == len(keys), name
            assert {"title", "question", "panel"} <= one.data.keys()
            if "case" not in one.data:
                assert points, name
                continue
            grid = {key: values[0] for key, values in one.data.get("grid", {}).items()}
            for variant in one.data.get("variants", [{}]):
                own = {key: value for key, value in variant.items() if key != "name"}
                values = {**one.data.get("set", {}), **grid, **own}
                assert fdnet.read_case(study.FOLDER / one.data["case"], values=values)


TOY = {
    "measure": "toy",
    "points": [{"series": "midpoint", "knob": "cells", "cells": [4, 8, 16, 32]}],
    "panel": [{"quantity": "integral error", "title": "integral of x²"}],
}


def toy(measure, **changes) -> study.Study:
    """Midpoint sums of x², measured by `measure`."""

    class Toy(study.Study):
        @property
        def measure(self):
            return measure

    return Toy("toy", TOY | changes, (Rule(["integral error"], "error"),))


def midpoint(point: study.Point, work: Path) -> dict[str, float]:
    with (work / "visited").open("a") as file:
        file.write(f"{point.value}\n")
    total = sum(((i + 0.5) / point.value) ** 2 for i in range(point.value)) / point.value
    return {"integral error": 3.0 * total - 1.0, "core_s": 1e-6 * point.value}


def test_a_study_measures_each_point_once_also_when_it_was_cut(tmp_path):
    def failing(point: study.Point, work: Path) -> dict[str, float]:
        if point.value == 8:
            raise FlowError("no path at 8; try 9")
        if point.value == 16:
            raise MemoryError
        if point.value == 32:
            raise KeyboardInterrupt
        return midpoint(point, work)

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        study.run_study(toy(failing), out)
    record = (out / study.POINTS).read_text()
    assert [json.loads(line)[1]["status"] for line in record.splitlines()] == [
        DONE, "refused: no path at 8", "over memory",
    ]  # fmt: skip
    with (out / study.POINTS).open("a") as file:
        file.write('["cut')
    table = study.run_study(toy(midpoint), out)
    assert (out / "work" / "visited").read_text().split() == ["4", "8", "16", "32"]
    assert table.error.tolist() == pytest.approx([-1 / (4 * n**2) for n in (4, 8, 16, 32)])
    assert judge.read_rows(out / "toy.csv").error.tolist() == pytest.approx(table.error.tolist())
    assert (out / "toy.png").read_bytes()[:4] == b"\x89PNG"
    assert "| midpoint | 4 | -1.56 % | 4e-06 |  |" in study.study_table(toy(midpoint), table)


@pytest.mark.liggghts
def test_a_quick_study_runs_end_to_end(tmp_path, capsys, monkeypatch):
    """Two runs by the campaign, a table, a picture; the same command then runs nothing."""
    out = tmp_path / "out"
    quick = study.read_study("stiffness", quick=True)
    two = {"grid": {"run.stiffness_N_m": [1e2, 1e4]}, "seeds": 1}
    small = quick._replace(data=quick.data | two)
    monkeypatch.setattr(study, "read_study", lambda name, quick: small)
    command = ["stiffness", "--quick", "--silent", "--out", str(out)]
    assert study.main(command) == 0
    table = judge.read_rows(out / "stiffness.csv")
    assert set(table.status) == {DONE}
    runs = table[table.quantity == "max_overlap"]
    assert len(runs) == 2
    assert runs.core_s.gt(0).all()
    assert runs.rss_mb.between(50, 5000).all()
    overlap = [one.error for one in judge.levels(table, "invasion, 0.10 mm", "max_overlap")]
    assert overlap[0] > 9 * overlap[1] > 0
    assert judge.levels(table, "invasion, 0.10 mm", "invaded")[1].error == 0.0
    assert "fines inside" in capsys.readouterr().out
    written = (out / "stiffness.csv").read_bytes()
    assert study.main(command) == 0
    assert (out / "stiffness.csv").read_bytes() == written

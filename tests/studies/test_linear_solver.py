"""The study of solvers: exact answers, bounds by tolerance and residual, refusals."""

import math

import numpy as np
import pytest

from fdnet.errors import FlowError
from tests.network.exact import exact_balance, random_links
from validation.command import run_study
from validation.engine.study import DONE
from validation.engine.table import read_rows
from validation.network.circuit import Circuit, circuit_of, exact_fluxes
from validation.network.linear_solver import OWN, STUDY, suffix
from validation.network.solver_peers import (
    AGGREGATION,
    DIRECT,
    FDNET,
    ITERATIVE,
    JACOBI,
    METHODS,
    RUGE_STUBEN,
    SPSOLVE,
    UNIT_DIAGONAL,
    solve_by,
)


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("study") / "out"
    run_study(STUDY, out, quick=True)
    result = read_rows(out / "linear-solver.csv")
    assert {row.status for row in result} == {DONE}
    return result


def errors(rows, method, decades, quantity, pores=200):
    name = f"{method}{suffix(pores, decades)}"
    return {
        row.value: row.error for row in rows if row.series == name and row.quantity == quantity
    }


def circuit_of_links(seed: int, decades: float) -> tuple[Circuit, np.ndarray]:
    """The random network of the exact tests as a circuit, and its exact fluxes."""
    ends, conductance, jump = random_links(seed, decades=decades, period=False)
    pores = int(ends.max())
    node = np.where(ends == 0, np.where(jump != 0, pores, pores + 1)[:, None], ends - 1)
    exact = exact_balance(ends, conductance, jump, pores + 1)[1]
    return Circuit(ends=node, conductance=conductance, count=pores), exact


@pytest.mark.parametrize("decades", [0, 8, 20])
@pytest.mark.parametrize("seed", range(3))
def test_eighty_digits_are_the_rational_answer(seed, decades):
    circuit, exact = circuit_of_links(seed, decades)
    assert exact_fluxes(circuit) == pytest.approx(
        exact, rel=1e-14, abs=1e-30 * np.abs(exact).max()
    )


@pytest.mark.parametrize("decades", [0, 8, 16])
def test_fdnets_own_choice_is_right_in_every_throat(rows, decades):
    assert errors(rows, FDNET, decades, "worst throat")[OWN] < 1e-9
    assert abs(errors(rows, FDNET, decades, "inflow")[OWN]) < 1e-9
    assert errors(rows, FDNET, decades, "residual")[OWN] < 1e-9


@pytest.mark.parametrize(("decades", "bound"), [(0, 1e-10), (8, 1e-9), (16, 1e-6)])
def test_direct_methods_lose_digits_with_the_spread_alone(rows, decades, bound):
    """They hold a throat's flux to eps times its conductance over the critical one."""
    for method in (DIRECT, SPSOLVE):
        assert errors(rows, method, decades, "worst throat")[OWN] < bound
        assert abs(errors(rows, method, decades, "inflow")[OWN]) < bound


@pytest.mark.parametrize("decades", [0, 8, 16])
@pytest.mark.parametrize("method", [RUGE_STUBEN, AGGREGATION, JACOBI])
def test_errors_follow_the_tolerance_and_stay_below_the_residual(rows, method, decades):
    inflow, residual = (errors(rows, method, decades, name) for name in ("inflow", "residual"))
    worst = errors(rows, method, decades, "worst throat")
    assert worst[1e-4] > 100 * worst[1e-8] > 1e4 * worst[1e-12] > 0
    # both over the inflow of the solve
    assert all(abs(off) / (1 + off) <= residual[value] for value, off in inflow.items())


def test_the_norm_of_the_residual_says_little_about_the_worst_throat(rows):
    """1e-8 of the source's norm leaves 5e-8 in equal throats, 1e-6 and more in unequal ones.

    This is why fdnet stops by the sum of imbalances.
    """
    left = {decades: errors(rows, JACOBI, decades, "worst throat")[1e-8] for decades in (0, 8, 16)}
    assert left[0] > 4e-8
    assert left[8] > 1e-6
    assert left[16] > 1e-6


def test_beyond_the_exact_size_methods_agree(rows):
    assert errors(rows, DIRECT, 8, "worst throat", pores=1000)[OWN] < 1e-9
    assert abs(errors(rows, RUGE_STUBEN, 8, "inflow", pores=1000)[1e-8]) < 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_a_chain_carries_its_series_conductance(method):
    """Five equal links in a row with a side arm: g / 5 through each, nothing in the arm."""
    ends = np.array([(4, 0), (0, 1), (1, 2), (2, 3), (3, 5), (6, 1)])
    ends = np.where(ends >= 4, ends + 1, ends)
    ends[5, 0] = 4
    solved = solve_by(method, Circuit(ends=ends, conductance=np.full(6, 3.0), count=5), 1e-12)
    assert solved.flux == pytest.approx([0.6] * 5 + [0.0], abs=1e-10)
    assert math.isnan(solved.steps) == (method not in ITERATIVE)


def test_steps_that_run_out_are_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(ITERATIVE, JACOBI, 5)
    with pytest.raises(
        FlowError, match="CG \\+ Jacobi: residual not below 1e-12 of the source in 5 steps"
    ):
        solve_by(JACOBI, circuit_of(200, 8.0, 0, tmp_path), 1e-12)


def test_a_unit_diagonal_costs_multigrid_steps(tmp_path):
    circuit = circuit_of(3000, 0.0, 0, tmp_path)
    plain, scaled = (
        solve_by(method, circuit, 1e-8).steps for method in (RUGE_STUBEN, UNIT_DIAGONAL)
    )
    assert scaled > 3 * plain

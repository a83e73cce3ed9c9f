"""The exact answer: balances of small networks solved in rational numbers."""

from fractions import Fraction

import numpy as np

from fdnet.spheres.snapshot import Array


def exact_balance(ends: Array, conductance: Array, jump: Array, count: int) -> tuple[float, Array]:
    """Throughput and fluxes (K,) by Gaussian elimination without rounding; node 0 has pressure 0.

    Every node must be tied to node 0. A link (a, b) carries g (p_a - p_b + jump).
    """
    g = [Fraction(float(value)) for value in conductance]
    drive = [Fraction(float(value)) for value in jump]
    rows = [[Fraction(0)] * (count + 1) for _ in range(count)]
    for (a, b), value, push in zip(ends.tolist(), g, drive, strict=True):
        for own, other, sign in ((a, b, 1), (b, a, -1)):
            rows[own][own] += value
            rows[own][other] -= value
            rows[own][count] -= sign * value * push
    rows[0] = [Fraction(int(column == 0)) for column in range(count)] + [Fraction(0)]
    for pivot in range(count):
        for below in range(pivot + 1, count):
            if rows[below][pivot]:
                share = rows[below][pivot] / rows[pivot][pivot]
                for column in range(pivot, count + 1):
                    rows[below][column] -= share * rows[pivot][column]
    p = [Fraction(0)] * count
    for row in reversed(range(count)):
        rest = sum(rows[row][column] * p[column] for column in range(row + 1, count))
        p[row] = (rows[row][count] - rest) / rows[row][row]
    links = zip(ends.tolist(), g, drive, strict=True)
    flux = [value * (p[a] - p[b] + push) for (a, b), value, push in links]
    throughput = sum(one * push for one, push in zip(flux, drive, strict=True))
    return float(throughput), np.array([float(one) for one in flux])


def random_links(
    seed: int, *, decades: float, period: bool, count: int = 16
) -> tuple[Array, Array, Array]:
    """Links of a random tree, and as many more between random nodes.

    Conductances are log-uniform over `decades`. Between planes, node 0 is both planes and a third
    of its links come from the inlet plane. With a period, some links have jumps of -1, 0 or 1.
    """
    rng = np.random.default_rng(seed)
    tree = [(int(rng.integers(node)), node) for node in range(1, count)]
    more = [tuple(map(int, rng.choice(count, 2, replace=False))) for _ in range(count)]
    ends = np.array(tree + more)
    conductance = 10.0 ** rng.uniform(-decades, 0.0, len(ends))
    if period:
        jump = rng.choice([-1.0, 0.0, 1.0], len(ends), p=[0.1, 0.8, 0.1])
        jump[-1] = 1.0
        return ends, conductance, jump
    jump = np.where(ends[:, 0] == 0, 1.0, 0.0) - np.where(ends[:, 1] == 0, 1.0, 0.0)
    jump *= rng.random(len(ends)) < 0.5
    return ends, conductance, jump

"""Elementary functions for loops against those of the C library."""

import numpy as np
import pytest

from fdnet.network.compiled import compiled_for_loops
from fdnet.network.laws.wedges import QUARTER, angle_of, cosine_of, log_of, sine_of


@compiled_for_loops
def logs(x, out):
    for i in range(len(x)):
        out[i] = log_of(x[i])


@compiled_for_loops
def turned(x, sine, cosine):
    for i in range(len(x)):
        sine[i], cosine[i] = sine_of(x[i]), cosine_of(x[i])


@compiled_for_loops
def angles(y, x, out):
    for i in range(len(x)):
        out[i] = angle_of(y[i], x[i])


def test_logarithms_over_all_magnitudes():
    edges = [2.0**e * m for e in (-500, -1, 0, 1, 500) for m in (1.0, np.sqrt(0.5), 1.0 - 1e-15)]
    x = np.concatenate([np.exp(np.linspace(-300.0, 300.0, 4001)), edges])
    out = np.empty(len(x))
    logs(x, out)
    assert out == pytest.approx(np.log(x), rel=5e-16, abs=5e-16)


def test_sine_and_cosine_of_a_half_turn():
    x = np.linspace(-QUARTER, QUARTER, 4001)
    sine, cosine = np.empty(len(x)), np.empty(len(x))
    turned(x, sine, cosine)
    assert sine == pytest.approx(np.sin(x), rel=1e-15, abs=0.0)
    assert cosine == pytest.approx(np.cos(x), rel=0.0, abs=5e-16)


def test_angles_all_round():
    turn = np.linspace(-np.pi, np.pi, 4001)[1:]
    size = np.exp(np.linspace(-30.0, 30.0, len(turn)))
    y, x = size * np.sin(turn), size * np.cos(turn)
    axes = np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 1.0], [-1.0, -1.0]])
    y, x = np.concatenate([y, axes[:, 0]]), np.concatenate([x, axes[:, 1]])
    out = np.empty(len(x))
    angles(y, x, out)
    assert out == pytest.approx(np.arctan2(y, x), rel=1e-15, abs=0.0)

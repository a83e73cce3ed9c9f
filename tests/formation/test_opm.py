"""OPM Flow as an oracle for the skin of a cake; it skips without `pip install opm-simulators`."""

import subprocess
import sys

import numpy as np
import pytest

from fdnet.formation.model import CAKE_SKINS

pytest.importorskip("opm.simulators", reason="needs the wheels opm and opm-simulators")

DECK = """\
RUNSPEC
DIMENS
 3 1 1 /
OIL
GAS
WATER
METRIC
TABDIMS
/
WELLDIMS
 2 3 1 2 /
START
 1 'JAN' 2025 /
UNIFOUT
GRID
DX
 3*10 /
DY
 3*10 /
DZ
 3*1 /
TOPS
 3*2000 /
PORO
 3*0.3 /
PERMX
 3*1000 /
PERMY
 3*1000 /
PERMZ
 3*1000 /
PROPS
PVTW
 200 1.0 4E-5 0.5 0 /
PVDO
 100 1.01 1.0
 300 1.00 1.0 /
PVDG
 100 0.01 0.02
 300 0.005 0.02 /
ROCK
 200 1E-5 /
DENSITY
 800 1000 1 /
SWOF
 0.25 0 1 0
 0.5 0.5 0.5 0
 1.0 1 0 0 /
SGOF
 0 0 1 0
 0.5 0.7 0 0
 0.75 1 0 0 /
SOLUTION
EQUIL
 2000 200 2500 0 1000 0 /
SUMMARY
CFCSKIN
 'I' /
/
CINJFVT
 'I' /
/
SCHEDULE
WELSPECS
 'I' 'G' 1 1 2000 'WATER' /
 'P' 'G' 3 1 2000 'OIL' /
/
COMPDAT
 'I' 1 1 1 1 'OPEN' 1* 1* 0.2 /
 'P' 3 1 1 1 'OPEN' 1* 1* 0.2 /
/
WINJDAM
 'I' SHAPE 10 0.4 0.1 1.0 /
/
WINJFCNC
 'I' 1000 /
/
WCONINJE
 'I' 'WATER' 'OPEN' 'RATE' 5 1* 500 /
/
WCONPROD
 'P' 'OPEN' 'BHP' 5* 150 /
/
TSTEP
 1 1 1 /
END
"""
"""Water with solids into a cube of 1000 mD: a cake of 10 mD and porosity 0.4 on 1 m2 at 0.1 m."""
RUN = """\
import sys
from opm.io.ecl import ESmry
from opm.simulators import BlackOilSimulator

flow = BlackOilSimulator("T.DATA")
flow.step_init()
while not flow.check_simulation_finished():
    flow.step()
flow.step_cleanup()
made = ESmry("T.SMSPEC")
for name in ("CINJFVT:I:1,1,1", "CFCSKIN:I:1,1,1"):
    print("RESULT", *map(float, made[name]))
"""


@pytest.mark.parametrize("shape", ["linear", "radial", "linrad"])
def test_the_skin_of_a_cake_is_that_of_opm_flow(shape, tmp_path):
    (tmp_path / "T.DATA").write_text(DECK.replace("SHAPE", shape.upper()))
    done = subprocess.run(
        [sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    rows = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("RESULT")]
    solids, skin = np.array(rows, float)
    thick = solids / (1.0 * (1 - 0.4))
    assert thick[-1] > 0.02
    expected = [1000 / 10 * CAKE_SKINS[shape](one / 0.1) for one in thick]
    assert skin == pytest.approx(expected, rel=1e-5)

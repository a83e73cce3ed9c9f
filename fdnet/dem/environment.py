"""The environment in which LIGGGHTS is started, with what Open MPI reads of it."""

import os

_ALWAYS = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
_ALONE = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_orte_create_session_dirs": "0",
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_btl": "self",
}
"""One rank talks to no other one. So it starts no daemon and looks for no network, which takes
Open MPI a third of a second at each start. It makes no folder in /tmp either: without the daemon
all processes would share one, and a process that ends would remove it while another one starts.
Another MPI does not read these variables."""


def environment(ranks: int) -> dict[str, str]:
    """The environment of this process, and what LIGGGHTS on so many `ranks` needs."""
    return os.environ | _ALWAYS | (_ALONE if ranks == 1 else {})

"""The environment of a process that works on one core, while others have cores of their own."""

from collections.abc import Mapping
from types import MappingProxyType

_THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ONE_CORE: Mapping[str, str] = MappingProxyType(dict.fromkeys(_THREADS, "1"))
"""What numpy, scipy and numba read when they are loaded."""

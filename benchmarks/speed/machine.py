"""What the machine can do at best, on one thread: how fast it moves memory and multiplies matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.speed.case import one_thread, seconds_of
from topoloc.geometry import Floats

LARGE_BYTES = 256 * 2**20
"""Of an array that no cache holds."""
SIDE = 1024
"""Of the matrices that are multiplied."""
REPEATS = 7


@dataclass(frozen=True)
class Limits:
    """Rates of one thread; of several tries the best, since a limit is meant.

    Attributes:
        copy_gb_s: memory read and written by copying a large array, both counted [GB/s].
        read_gb_s: memory read by summing one up [GB/s].
        matmul32_gflop_s: multiplications and additions of a product of float32 matrices [10^9/s].
        matmul64_gflop_s: the same of float64.
    """

    copy_gb_s: float
    read_gb_s: float
    matmul32_gflop_s: float
    matmul64_gflop_s: float

    def row(self) -> dict[str, str | float]:
        """The limits as ``topoloc speed --json`` prints them."""
        rates = {name: round(rate, 2) for name, rate in asdict(self).items()}
        return {"what": "machine", "size": f"{LARGE_BYTES // 2**20} MiB, {SIDE} x {SIDE}", **rates}

    def __str__(self) -> str:
        return (
            f"This machine, one thread, at best: copies {self.copy_gb_s:.1f} GB/s (read and written), reads "
            f"{self.read_gb_s:.1f} GB/s, multiplies matrices at {self.matmul32_gflop_s:.0f} (float32) and "
            f"{self.matmul64_gflop_s:.0f} (float64) Gflop/s."
        )

    def seconds(self, read: float = 0.0, written: float = 0.0, flops32: float = 0.0, flops64: float = 0.0) -> float:
        """The least time for so many bytes and operations: the longer of both, since they overlap [s]."""
        moving = read / self.read_gb_s if written == 0.0 else (read + written) / self.copy_gb_s
        return 1e-9 * max(moving, flops32 / self.matmul32_gflop_s + flops64 / self.matmul64_gflop_s)


def limits() -> Limits:
    """Measure them; takes about two seconds and half a GB of memory."""
    source: Floats = np.ones(LARGE_BYTES // 8)
    target = np.zeros_like(source)
    with one_thread():
        return Limits(
            2.0 * LARGE_BYTES * _rate(lambda: np.copyto(target, source)),
            LARGE_BYTES * _rate(source.sum),
            2.0 * SIDE**3 * _rate(_product(np.float32)),
            2.0 * SIDE**3 * _rate(_product(np.float64)),
        )


def _rate(call: Callable[[], object]) -> float:
    """Calls in a nanosecond, at best."""
    call()
    return 1e-9 / min(seconds_of(call) for _ in range(REPEATS))


def _product(kind: type[np.floating]) -> Callable[[], object]:
    rng = np.random.default_rng(0)
    first, second = rng.random((SIDE, SIDE)).astype(kind), rng.random((SIDE, SIDE)).astype(kind)
    return lambda: first @ second

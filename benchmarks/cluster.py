"""A dask cluster as joblib's backend, which tells of what can never be done where joblib's own waits for ever."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from importlib.metadata import version
from time import monotonic
from typing import Any

from dask import config
from distributed import Client, LocalCluster
from joblib import cpu_count
from joblib._dask import DaskDistributedBackend

from topoloc import __version__
from topoloc.errors import UserError, one_line

LOCAL = "local"
ANSWER_S = 5.0
"""So long a scheduler may take to answer [s]."""
LOOK_S = 0.5
"""How often to look whether there are any [s]."""
RESUME = "look after the cluster, then continue with --resume"
ONE_THREAD = {f"{name}_NUM_THREADS": 1 for name in ("OMP", "MKL", "OPENBLAS")}
"""What workers get in their environment. Dask's own choice also has them give back memory at every turn, by which
sensors take about twice as long: their times could not be compared with those of other runs."""
QUIETLY = """
import logging, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
logging.getLogger("distributed").setLevel(logging.CRITICAL)
"""
"""For the workers of a cluster of this machine, which a terminal's Ctrl-C would reach, too, each with a traceback."""


@contextmanager
def joined(address: str, patience_s: float) -> Iterator[WatchedCluster]:
    """A cluster for ``joblib.parallel_config``; one that was started here ends with the block.

    Args:
        address: of its scheduler, or ``local``: one process per core of this machine.
        patience_s: so long it may be without a worker.

    Raises:
        UserError: nobody answers there, or no worker comes.
    """
    with _silence(), _own() if address == LOCAL else _client(address, patience_s) as client:
        yield WatchedCluster(client, address, patience_s)


def refuse_unreachable(address: str, patience_s: float) -> None:
    """Raise ``UserError`` where no cluster with workers answers at an address; there is nothing to ask of ``local``."""
    if address != LOCAL:
        with _silence(), _client(address, patience_s):
            pass


class WatchedCluster(DaskDistributedBackend):  # type: ignore[misc]  # joblib has no types
    """joblib's backend for dask; joblib 1.6's own waits for ever for a task given up, or for a cluster that is gone.

    Args:
        client: of the cluster.
        address: as the user named it.
        patience_s: so long the cluster may be without a worker.
    """

    def __init__(self, client: Client, address: str, patience_s: float) -> None:
        super().__init__(client=client)
        self.address, self.patience_s = address, patience_s
        self._pending = dict[Future[Any], Callable[[Any], None]]()
        self._watching = False

    def effective_n_jobs(self, n_jobs: int = 1) -> int:
        """Never 1, which joblib would take for no cluster: it would do the work in this process."""
        return max(2, int(super().effective_n_jobs(n_jobs)))

    def submit(self, func: Any, callback: Callable[[Any], None]) -> Future[Any]:
        """Hand a task over; the callback is told what the task gave, or why it can never be done."""
        future: Future[Any] = super().submit(func, callback)
        self._pending[future] = callback
        future.add_done_callback(self._settle)
        return future

    def retrieve_result_callback(self, out: Any) -> Any:
        """What a task gave. Raises ``UserError`` where it gave nothing."""
        if isinstance(out, UserError):
            raise out
        if isinstance(out, BaseException):  # not the task's own: those come packed
            raise UserError(f"{self._place} gave up a task ({one_line(out)}); {RESUME}") from out
        return super().retrieve_result_callback(out)

    def start_call(self) -> None:
        """Begin to watch."""
        super().start_call()
        self._watching = True
        self.client.loop.add_callback(self._watch)

    def stop_call(self) -> None:
        """Watch no longer."""
        self._watching = False
        super().stop_call()

    @property
    def _place(self) -> str:
        return f"--cluster {self.address}: the cluster"

    def _settle(self, future: Future[Any]) -> None:
        """Call back for what went wrong, too: joblib does so for what went well only."""
        callback = self._pending.pop(future, None)
        if callback is not None and (error := future.exception()) is not None:
            callback(error)

    async def _watch(self) -> None:
        """Once there has been no worker for too long, say so to all that wait."""
        seen = monotonic()
        while self._watching:
            await asyncio.sleep(LOOK_S)
            if self.client.status == "running" and await self._workers():
                seen = monotonic()
            elif monotonic() - seen > self.patience_s:
                for callback in list(self._pending.values()):
                    callback(UserError(f"{self._place} has no worker any more; {RESUME}"))
                return

    async def _workers(self) -> int:
        try:
            return len(await self.client.scheduler.ncores())
        except OSError:  # the scheduler went just now
            return 0


@contextmanager
def _own() -> Iterator[Client]:
    """A cluster of this machine's cores, reachable from here only."""
    with (
        config.set({"distributed.nanny.pre-spawn-environ": ONE_THREAD}),
        LocalCluster(
            n_workers=cpu_count(),
            threads_per_worker=1,
            memory_limit=0,
            host="127.0.0.1",
            dashboard_address=None,
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},  # else it wants port 8787
            preload=QUIETLY,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def _client(address: str, patience_s: float) -> Iterator[Client]:
    """A client of somebody's cluster, once that has a worker."""
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        raise UserError(
            f"--cluster {address}: no dask scheduler answers there ({one_line(error)}); start one with "
            "'dask scheduler', and workers with 'dask worker ADDRESS --nthreads 1', or give 'local'"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=patience_s)
        except TimeoutError:
            raise UserError(
                f"--cluster {address}: the scheduler has no workers; start some with "
                f"'dask worker {address} --nthreads 1' where topoloc {__version__} is installed"
            ) from None
        _refuse_other_versions(client, address)
        yield client


def _refuse_other_versions(client: Client, address: str) -> None:
    """Where topoloc is missing a task cannot even be read; another version's rows could not be told from ours."""
    for worker, found in client.run(version, "topoloc", on_error="return").items():
        if found != __version__:
            has = f"topoloc {found}" if isinstance(found, str) else "no topoloc"
            raise UserError(f"--cluster {address}: the worker {worker} has {has}; install topoloc {__version__} there")


@contextmanager
def _silence() -> Iterator[None]:
    """No logs of dask's: what matters becomes an error here."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)

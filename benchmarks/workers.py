"""Who does the tasks of a benchmark: this process, several of this machine, or those of a cluster."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Sequence
from importlib import import_module
from signal import SIG_IGN, SIGINT, signal
from threading import Lock
from types import ModuleType
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from benchmarks.drives import killed_rows, run_task
from benchmarks.runner import Outcome, Suite, Task
from topoloc.errors import UserError

ATTEMPTS = 2
"""After a process of this machine was killed, what was not done yet is begun again once; then each task alone."""

Numbered = tuple[int, list[Outcome]]

_alone = Lock()
"""A dask worker may have several threads; what limits libraries to one, and remembers drives, holds for a process."""


def in_processes(suite: Suite, tasks: Sequence[Task], jobs: int) -> Generator[Outcome]:
    """Do tasks in so many processes of this machine; with one, in this one.

    A process may be killed: by somebody, for want of memory, by what a sensor does. What it was doing is done again, in
    the end alone in a process; a task that is killed there, too, has failed.
    """
    if min(jobs, len(tasks)) <= 1:
        for task in tasks:
            yield from run_task(suite, task)
        return
    left = dict(enumerate(tasks))
    for _ in range(ATTEMPTS):
        try:
            yield from _here(suite, left, min(jobs, len(left)))
            return
        except TerminatedWorkerError:
            continue
    for number, task in list(left.items()):
        try:
            yield from _here(suite, {number: task}, 2)  # with 1, joblib would do it in this process
        except TerminatedWorkerError:
            yield from killed_rows(task)


def _here(suite: Suite, left: dict[int, Task], processes: int) -> Generator[Outcome]:
    with parallel_config(backend="loky", inner_max_num_threads=1, initializer=_leave_ctrl_c_to_us):
        yield from _unordered(suite, left, n_jobs=processes)


def _leave_ctrl_c_to_us() -> None:
    """A terminal would stop the processes together with us, each with a traceback; we end them ourselves."""
    signal(SIGINT, SIG_IGN)


def on_cluster(suite: Suite, tasks: Sequence[Task], address: str, patience_s: float = 30.0) -> Generator[Outcome]:
    """Do tasks on the workers of a dask cluster; what a worker was doing when it died is done by another.

    Args:
        suite: what they are from; it travels to the workers, which need the same version of topoloc, and the folders of
            recorded scenarios under the same paths.
        tasks: to do.
        address: of the scheduler, as in ``tcp://host:8786``, or ``local`` for a cluster of this machine's cores.
        patience_s: so long it may be without any worker [s], as while the first start, or the last start again.

    Raises:
        UserError: dask is not installed, nobody answers, or the cluster cannot do it.
    """
    with _cluster().joined(address, patience_s) as backend, parallel_config(backend=backend):
        yield from _unordered(suite, dict(enumerate(tasks)), pre_dispatch="all", batch_size=1)


def refuse_unreachable(address: str, patience_s: float = 30.0) -> None:
    """Raise ``UserError`` where ``on_cluster`` could not begin, before anything is written."""
    _cluster().refuse_unreachable(address, patience_s)


def _cluster() -> ModuleType:
    try:
        return import_module("benchmarks.cluster")
    except ImportError as error:
        raise UserError(
            f"--cluster needs dask.distributed ({error.name} is missing); pip install 'topoloc[cluster]'"
        ) from None


def _unordered(suite: Suite, left: dict[int, Task], **settings: Any) -> Generator[Outcome]:
    """The outcomes of tasks as they come, a task's together; what has come is no longer left."""
    parallel = Parallel(return_as="generator_unordered", **settings)
    batches = parallel(delayed(_numbered)(number, suite, task) for number, task in list(left.items()))
    with warnings.catch_warnings(action="ignore", category=UserWarning):  # loky's: that it renewed a large process
        try:
            for number, outcomes in batches:
                del left[number]
                yield from outcomes
        finally:
            batches.close()  # joblib warns that not all of it was used


def _numbered(number: int, suite: Suite, task: Task) -> Numbered:
    """All outcomes of a task at once, as another process hands them back."""
    with _alone:
        return number, list(run_task(suite, task))

"""Who does the tasks of a benchmark: this process, several of this machine, or those of a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from benchmarks.drives import run_task
from benchmarks.runner import Outcome, Suite, Task
from topoloc.errors import UserError


def in_processes(suite: Suite, tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Do tasks in so many processes of this machine; with one, in this one."""
    processes = min(jobs, len(tasks))
    if processes <= 1:
        for task in tasks:
            yield from run_task(suite, task)
        return
    try:
        with parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = Parallel(n_jobs=processes, return_as="generator_unordered", pre_dispatch=processes)
            for batch in parallel(delayed(done)(suite, task) for task in tasks):
                yield from batch
    except TerminatedWorkerError:
        raise UserError("a process was killed, perhaps for want of memory; continue with --resume, --jobs 1") from None


def done(suite: Suite, task: Task) -> list[Outcome]:
    """All outcomes of a task at once, as another process hands them back."""
    return list(run_task(suite, task))

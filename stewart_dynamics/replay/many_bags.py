# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Many bags, replayed independently: in this process, in several processes, or on a Dask cluster.

An error in one bag does not stop the others. A bag whose process dies is started again. Each run
has an identifier that is written to all its results: a bag that the process had finished
before it died is recognized by it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from functools import partial
import os
from pathlib import Path
import sys
import threading
from typing import NamedTuple
import uuid

from stewart_dynamics.bags.find import bytes_of, FLEET_PAGE, FLEET_TABLE
from stewart_dynamics.errors import BagError
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import BAD_INPUT, DONE, PARTLY_READ
from stewart_dynamics.replay.bag_task import (
    At, counted, Ended, failed, finished, kept, LOCAL_INTERVAL, replay_task, Task)
from stewart_dynamics.replay.index import (
    Cell, IN_WORDS, listed_results, SEVERITY, write_fleet)
from stewart_dynamics.replay.replay_options import LIMIT_MET, Options
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.results_folder import remove_abandoned
from stewart_dynamics.whole_file import FilesOfFolder
from tqdm import tqdm

_SEVERITY = (DONE, LIMIT_MET, PARTLY_READ, BAD_INPUT).index


class Fleet(NamedTuple):
    """The outcome of all bags, in the order in which they were given."""

    ended: tuple[Ended, ...]

    def code(self, strict: bool) -> int:
        """Return the most severe exit code; exceeded limits count only if strict."""
        codes = (each.code for each in self.ended)
        return max((code for code in codes if strict or code != LIMIT_MET), key=_SEVERITY,
                   default=DONE)

    def text(self) -> str:
        """Return the number of bags by result, and a line for every bag with an error."""
        number = Counter(str(each.row['result']) for each in self.ended)
        counts = ', '.join(f'{number[result]} {IN_WORDS.get(result, result)}'
                           for result in SEVERITY if number[result])
        unchanged = sum(each.kept for each in self.ended)
        if unchanged:
            counts += f'; {unchanged} kept from an earlier run, their inputs have not changed'
        return '\n'.join([f'{plural(len(self.ended), "bag")}: {counts}',
                          *(each.error for each in self.ended if each.error)])


def replay_fleet(
        bags: Sequence[tuple[Path, Path]], parameters: Parameters, output: Path,
        options: Options, jobs: int = 1, scheduler: str | None = None,
        show_progress: bool | None = None) -> Fleet:
    """
    Replay bags and write fleet.csv and index.html, a row for each bag.

    bags: each with the folder of its results, from bags.folders_of_results.
    output: folder of fleet.csv and index.html.
    options: options of every bag. ``run`` is set if it is empty.
    jobs: number of processes; 1: this one.
    scheduler: address of a Dask scheduler whose workers replay the bags. They must have this
        package and see the bags and ``output`` at the same paths as this process.
    show_progress: show the progress on stderr; by default if stderr is a terminal.

    Results of an earlier run are kept if bag, parameters, options and program have not changed,
    unless ``options.force``.

    Raises StewartError if files of another run would be replaced, or if the cluster cannot be
    reached. Errors in a bag are written to its row. KeyboardInterrupt stops the run; finished
    bags keep their results.
    """
    output.mkdir(parents=True, exist_ok=True)
    files = FilesOfFolder(output, replace=True)  # _check_replaceable says whether
    options = options._replace(run=options.run or uuid.uuid4().hex)
    tasks = [Task(number, bag, folder, parameters, options)
             for number, (bag, folder) in enumerate(bags)]
    ended: dict[int, Ended] = {}
    if not options.force:
        ended = {task.number: found for task in tasks if (found := kept(task)) is not None}
    _check_replaceable(tasks, ended, output, options)
    remove_abandoned(task.folder for task in tasks)
    sizes = [0 if task.number in ended else bytes_of(task.bag) for task in tasks]
    # The largest first: started last, it would run alone at the end.
    order = sorted((task for task in tasks if task.number not in ended),
                   key=lambda task: -sizes[task.number])
    try:
        with closing(_ProgressBar(sizes, show_progress, len(ended))) as bar, closing(
                _results(order, jobs, scheduler, bar.at)) as results:
            for task, result in results:
                ended[task.number] = result._replace(bag=task.bag, folder=task.folder)
                bar.end(task.number, result)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f'{len(ended)} of {len(tasks)} bags are done; the same command '
                                'continues with the others') from None
    finally:
        # of processes that died
        remove_abandoned((task.folder for task in tasks), options.run)
    fleet = Fleet(tuple(ended[number] for number in range(len(tasks))))
    write_fleet(output, [_row(each, output) for each in fleet.ended], files)
    return fleet


def _results(tasks: Sequence[Task], jobs: int, scheduler: str | None, at: At,
             ) -> Generator[tuple[Task, Ended], None, None]:
    """Yield the outcome of each bag, as they end; closing the generator stops the run."""
    if not tasks:
        return
    if scheduler is not None:
        from stewart_dynamics.replay.dask_cluster import cluster
        workers = cluster(scheduler, tasks[0].options.run, at)
    elif jobs > 1:
        from stewart_dynamics.replay.local_processes import processes
        workers = processes(jobs, at)
    else:
        for task in tasks:
            yield task, replay_task(task, counted(partial(at, task.number), LOCAL_INTERVAL))
        return
    with workers as replayed:
        died = []
        for task, ended in replayed(tasks):
            if ended is None:
                died.append(task)
            else:
                yield task, ended
        # Each of them alone: others cannot end it a second time by their need of memory, and Dask
        # also blames bags that only waited for a worker that died.
        for suspect in died:
            for task, ended in replayed([suspect]):
                yield task, ended or finished(task) or failed(
                    task, 'every process that replayed it was killed (out of memory?)')


def _check_replaceable(tasks: Sequence[Task], done: Mapping[int, Ended], output: Path,
                       options: Options) -> None:
    """Raise BagError if fleet.csv and index.html must not be replaced."""
    table, page = output / FLEET_TABLE, output / FLEET_PAGE
    for path in (table, page):
        if path.is_dir():
            raise BagError(f'{path}: exists already and is a folder')
    if options.force or not (table.exists() or page.exists()):
        return
    listed = listed_results(table)
    if listed is None:
        raise BagError(f'{table if table.exists() else page}: exists already; --force replaces '
                       'results')
    others = listed - {_results_folder(task.folder, output) for task in tasks}
    if others:
        raise BagError(f'{table}: lists {min(others)}, which is not part of this run; --force '
                       'replaces it')
    for task in tasks:
        if task.number not in done and task.folder.exists():
            raise BagError(f'{task.folder}: exists already, of other inputs: bag, parameters, '
                           'options or version have changed; --force replaces results')


def _results_folder(folder: Path, output: Path) -> str:
    return Path(os.path.relpath(folder, output)).as_posix()


def _row(ended: Ended, output: Path) -> dict[str, Cell]:
    results = None if ended.code == BAD_INPUT else _results_folder(ended.folder, output)
    return {**ended.row, 'bag': str(ended.bag), 'results': results}


class _ProgressBar:
    """
    A line on stderr: bags, setpoints, their rate and the time left.

    The time left is estimated from the sizes of the bags, zero for those that need not be
    replayed.
    """

    def __init__(self, sizes: Sequence[int], show: bool | None, ended: int) -> None:
        self._sizes, self._ended = sizes, ended
        self._read, self._setpoints = [0] * len(sizes), [0] * len(sizes)
        self._lock = threading.Lock()  # Dask reports progress in another thread
        self._line = tqdm(
            total=sum(sizes), file=sys.stderr, dynamic_ncols=True, smoothing=0.1,
            disable=True if not sum(sizes) else None if show is None else not show,
            bar_format='{percentage:3.0f}%|{bar}| {desc}, {remaining} left')

    def at(self, number: int, read: int, setpoints: int) -> None:
        """Show that these bytes and setpoints of a bag are done."""
        with self._lock:
            # Part of a bag may be read twice.
            read = min(read, self._sizes[number])
            more = read - self._read[number]
            self._read[number], self._setpoints[number] = read, setpoints
            total = sum(self._setpoints)
            passed = self._line.format_dict['elapsed']
            self._line.set_description_str(
                f'{self._ended}/{len(self._sizes)} bags, {_short(total)} setpoints, '
                f'{_short(total / passed) if total and passed else "?"}/s', refresh=False)
            self._line.update(more)

    def end(self, number: int, ended: Ended) -> None:
        """Show that a bag is done."""
        self._ended += 1
        self.at(number, self._sizes[number], int(ended.row.get('setpoints') or 0))

    def close(self) -> None:
        """End the line."""
        self._line.refresh()
        self._line.close()


def _short(number: float) -> str:
    return f'{number:.0f}' if number < 1000 else tqdm.format_sizeof(number)

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the tests that run the executables or a browser."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing, ExitStack
import gc
import importlib
from importlib.util import find_spec
from itertools import count
import os
from pathlib import Path
import re
import shutil
import signal
import sys
from types import ModuleType
from typing import Any, TYPE_CHECKING

from hypothesis import settings
import pytest
from snapshot import Snapshot

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from running import DynamicsNode, NodeProcess, Peer
    from xdist.remote import Producer
    from xdist.scheduler.protocol import Scheduling
    from xdist.workermanage import WorkerController

# Before numpy is imported, in this process and those that it starts: with matrices as small as
# these, waiting threads cost as much again, and other processes need the cores.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# Whoever runs the tests may ignore signals (nohup; a shell's background job), and processes
# inherit it. The tests send them, and ask what a program does that heeds them.
HANDLERS = {signal.SIGHUP: signal.SIG_DFL, signal.SIGINT: signal.default_int_handler,
            signal.SIGTERM: signal.SIG_DFL}

BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')
FLAGS = ('--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
         '--disable-background-networking', '--disable-component-update', '--disable-sync',
         '--use-angle=swiftshader', '--enable-unsafe-swiftshader')

# The same examples in every run, which may take long on a loaded computer: few.
settings.register_profile('repeatable', deadline=None, derandomize=True, max_examples=30)
settings.load_profile('repeatable')


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that writes the sentences of programs."""
    parser.addoption('--update-snapshots', action='store_true',
                     help='write test/snapshots/ instead of comparing with it; one process')


@pytest.fixture
def snapshot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory,
             ) -> Iterator[Snapshot]:
    """Return the known sentences of this test, in the file of the module's PROGRAM."""
    program = getattr(request.module, 'PROGRAM', 'library')
    each = Snapshot(program, f'{request.path.name}::{request.node.name}',
                    tmp_path_factory.getbasetemp(), request.config.getoption('update_snapshots'))
    failed = request.session.testsfailed
    yield each
    if request.session.testsfailed == failed:
        each.close()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """
    Collect the tests without looking for garbage, which takes a third of the time.

    All that is there by then stays until the end.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


# The module running needs ROS; the tests of the library do not, so it is imported where used.

ROS_PACKAGE = re.compile(r'rclpy|\w+_(msgs|srvs|interfaces)')


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
        collector: pytest.Collector,
        ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip a module of tests that imports ROS if it is not installed."""
    report = yield
    if report.failed:
        skip_without_ros(report, report.call.excinfo.value.__cause__, str(collector.path), 0)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
        item: pytest.Item, call: pytest.CallInfo[None],
        ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a test that imports ROS, itself or in a fixture, if it is not installed."""
    report = yield
    if report.failed and call.excinfo is not None:
        skip_without_ros(report, call.excinfo.value, *item.reportinfo()[:2])
    return report


def skip_without_ros(report: pytest.CollectReport | pytest.TestReport,
                     error: BaseException | None, path: str | os.PathLike[str],
                     line: int | None) -> None:
    """Make the report one of a skipped test if the error is that ROS is not installed."""
    if isinstance(error, ModuleNotFoundError) and find_spec('rclpy') is None and (
            ROS_PACKAGE.match(error.name or '')):
        report.outcome = 'skipped'
        report.longrepr = str(path), line or 0, f'Skipped: needs ROS: no {error.name} here'


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests with ROS; put their modules first, and slow ones at both ends."""
    for item in items:
        if 'ros_environment' in getattr(item, 'fixturenames', ()):
            item.add_marker('ros')
    having = {mark: {item.path for item in items if item.get_closest_marker(mark)}
              for mark in ('ros', 'slow')}
    items.sort(key=lambda item: (item.path not in having['ros'], (
        item.path in having['ros']) != (item.path in having['slow'])))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """
    Give every second process the modules from the end, which compute.

    The others wait for ROS half of the time: meanwhile these have the processors.
    """
    if config.getvalue('dist') != 'loadfile':
        return None
    from xdist.scheduler import LoadFileScheduling

    class Pools(LoadFileScheduling):
        def _assign_work_unit(self, node: WorkerController) -> None:
            if self.nodes.index(node) % 2:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

        def _reschedule(self, node: WorkerController) -> None:
            # A worker in place of one that crashed gets work when it has collected the tests;
            # xdist gives it some at the next crash or collection of another, and ends by KeyError.
            if node in self.registered_collections:
                super()._reschedule(node)

    return Pools(config, log)


@pytest.fixture(scope='session', autouse=True)
def heeded_signals() -> None:
    """Heed signals before the first process is started."""
    heed_signals()


@pytest.fixture(autouse=True)
def signals() -> None:
    """Heed them again, whatever a program has done with them that ran in this process before."""
    heed_signals()


def heed_signals() -> None:
    for number, handler in HANDLERS.items():
        if signal.getsignal(number) != handler:
            signal.signal(number, handler)


@pytest.fixture(scope='module')
def browser() -> Iterator[Browser]:
    """Return a browser; skip the test if no browser is installed."""
    playwright = pytest.importorskip('playwright.sync_api', reason='playwright is not installed')
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f'no browser on this computer: none of {", ".join(BROWSERS)}')
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=found, args=FLAGS, timeout=300_000.0)
        yield running
        running.close()


@pytest.fixture(scope='module')
def demo(request: pytest.FixtureRequest) -> ModuleType:
    """Return the module of demo/ that is the test module's DEMO."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[1] / 'demo'))
        return importlib.import_module(request.module.DEMO)


@pytest.fixture
def rejects(demo: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
            snapshot: Snapshot) -> Callable[..., None]:
    """Return a function that checks that the demo rejects options in one line."""
    def run(*options: object) -> None:
        for name in ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_DOMAIN_ID'):
            monkeypatch.setenv(name, '1')  # main sets missing ones
        monkeypatch.setattr(sys, 'argv', [demo.__name__, '--output', str(tmp_path / 'out'),
                                          *map(str, options)])
        # A text as exit code is printed as a line, with exit code 1.
        with pytest.raises(SystemExit, match=f'^demo-{demo.__name__}: [^\n]*$') as ended:
            demo.main()
        assert isinstance(ended.value.code, str)
        snapshot(ended.value.code)

    return run


@pytest.fixture(scope='session')
def ros_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep ROS on this machine and its logs out of the home folder; announce nodes often."""
    from stewart_dynamics.ros.security import PROFILES
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        patch.setenv(PROFILES, str(Path(__file__).with_name('discovery.xml')))
        patch.setenv('ROS_LOG_DIR', str(tmp_path_factory.mktemp('log')))
        for name in ('ROS_DOMAIN_ID', 'ROS_STATIC_PEERS', 'ROS_LOCALHOST_ONLY',
                     'RCUTILS_CONSOLE_OUTPUT_FORMAT',
                     'RCUTILS_COLORIZED_OUTPUT'):
            patch.delenv(name, raising=False)
        yield


@pytest.fixture
def domain(ros_environment: None) -> Iterator[int]:
    """Return a ROS domain that only this test has."""
    from running import own_domain
    with own_domain() as number:
        yield number


@pytest.fixture
def peer(domain: int) -> Iterator[Peer]:
    """Return a participant in a domain that only this test has."""
    from running import Peer
    with closing(Peer(domain)) as each:
        yield each


@pytest.fixture(scope='module')
def shared(ros_environment: None, tmp_path_factory: pytest.TempPathFactory,
           ) -> Iterator[NodeProcess]:
    """Return the process in which a module's tests have the node, one after the other."""
    from running import NodeProcess
    process = NodeProcess(tmp_path_factory.mktemp('shared'))
    try:
        yield process
    finally:
        process.close()


@pytest.fixture
def start(ros_environment: None, tmp_path: Path,
          ) -> Iterator[Callable[..., DynamicsNode]]:
    """Return a function that starts a node in a process of its own; it stops with the test."""
    from running import DynamicsNode, NodeProcess
    with ExitStack() as stack:
        def begin(*overrides: str, **options: Any) -> DynamicsNode:
            folder = tmp_path / f'node_{next(numbers)}'
            process = stack.enter_context(closing(NodeProcess(folder, *overrides, **options)))
            return stack.enter_context(closing(DynamicsNode(process)))

        numbers = count(1)
        yield begin


@pytest.fixture
def fresh(request: pytest.FixtureRequest, shared: NodeProcess,
          ) -> Iterator[Callable[..., DynamicsNode]]:
    """
    Return a function that gives the module's node, as good as new, with these parameters.

    It is active when ``until_active`` returns. Where a test fails its process is not used again.
    """
    from running import DynamicsNode
    failed = request.session.testsfailed
    with ExitStack() as stack:
        def begin(*overrides: str) -> DynamicsNode:
            stack.pop_all().close()  # of the same process there is one at a time
            return stack.enter_context(closing(DynamicsNode(shared, *overrides)))

        yield begin
        if request.session.testsfailed > failed:
            shared.kill()


@pytest.fixture
def node(fresh: Callable[..., DynamicsNode]) -> DynamicsNode:
    """Return the module's node, as good as new and active."""
    each = fresh()
    each.until_active()
    return each

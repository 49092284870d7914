# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A controller in the loop with the simulated hexapod: what the demos have in common.

The simulator owns time and waits for each command, so that no figure depends on the load of the
computer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import io
import os
from pathlib import Path
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
import numpy as np
from numpy.typing import NDArray
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.messages.setpoint import read_message
from stewart_dynamics.messages.type_names import POSE_STAMPED
from stewart_dynamics.whole_file import write_files
from tqdm import tqdm
import yaml

if TYPE_CHECKING:
    from typing_extensions import Self

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
SIMULATOR = '/stewart_simulator'
QOS = QoSProfile(depth=1000)
BEGIN = 1_000_000_000  # of simulated time [ns]
PLOTS = {'font.size': 10, 'axes.grid': True, 'grid.color': '0.88', 'axes.spines.top': False,
         'axes.spines.right': False}  # parameters of matplotlib
BANDWIDTH = 8.0  # natural frequency of a leg under PD control [Hz]
# Longer than any wait on an idle computer, including the compilation of two programs [s].
PATIENCE = 60.0
# Time of a demo for each second of motion, until it is measured: on the computer of
# benchmarks/README.md, with all compiled.
PACE = 2.5
LOOK = 0.1  # interval between checks of programs and progress [s]

UNITS = {**{f'leg {n}': 'um' for n in range(1, 7)}, 'all legs': 'um', 'position': 'um',
         'rotation': 'urad'}


def units(kind: LegKind) -> dict[str, str]:
    """Return the units of the errors of hexapods with a kind of legs."""
    return {name: f'u{kind.position.unit}' if 'leg' in name else unit
            for name, unit in UNITS.items()}


class Failure(Exception):
    """Ends the demo; its text is one line."""


class Errors(NamedTuple):
    """Measured minus desired state at the same times, N samples."""

    seconds: Array
    """Since the start of the motion (N,)."""
    legs: Array
    """Of the lengths (N, 6) [um], or of the angles of the drives [urad]."""
    position: Array
    """Distance of the platform's origin (N,) [um]."""
    rotation: Array
    """Angle (N,) [urad]."""

    @property
    def rms(self) -> dict[str, float]:
        """Root of the mean square of each series of errors."""
        return self._of_each(lambda each: np.sqrt(np.mean(np.square(each))))

    @property
    def peak(self) -> dict[str, float]:
        """Largest of each."""
        return self._of_each(lambda each: np.abs(each).max())

    def _of_each(self, figure: Callable[[Array], Any]) -> dict[str, float]:
        series = [*self.legs.T, self.legs, self.position, self.rotation]
        return {name: float(figure(each)) for name, each in zip(UNITS, series, strict=True)}


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG, complete or not at all."""
    png = io.BytesIO()
    figure.savefig(png, dpi=110, metadata={'Software': None})
    write_files({path: png.getvalue()})


class Recorder(Node):
    """Records the measured states."""

    def __init__(self) -> None:
        super().__init__('recorder')
        self.diagnostics: dict[str, str] = {}
        self.states = self._kept(JointState, f'{SIMULATOR}/leg_states')
        self.poses = self._kept(PoseStamped, f'{SIMULATOR}/pose')
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)

    def _kept(self, kind: Any, topic: str) -> list[bytes]:
        messages: list[bytes] = []
        self.create_subscription(kind, topic, messages.append, QOS, raw=True)
        return messages

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics.update({pair.key: pair.value for pair in status.values})

    def ready(self) -> bool:
        """
        Return whether the simulator is received and the controller is subscribed to the node.

        The node answers each setpoint once, so the controller must be connected before the first.
        Everything else is repeated, or waited for, until it is received.
        """
        return (int(self.diagnostics.get('leg_states: readers', 0)) > 0
                and bool(self.states) and bool(self.poses))

    @property
    def time(self) -> int:
        """Return the simulated time since its start [ns]."""
        last = min((stamp_of(each[-1]) for each in (self.states, self.poses) if each), default=0)
        return max(last - BEGIN, 0)

    def errors(self, times: NDArray[np.int64], lengths: Array, desired: Motion) -> Errors:
        """Return the errors from a motion (N,) and its leg positions (N, 6) at its times."""
        states = {stamp_of(data): np.array(deserialize_message(data, JointState).position)
                  for data in self.states}
        poses = {read.stamp: read.values
                 for read in (read_message(POSE_STAMPED, data) for data in self.poses)}
        stamps = (BEGIN + times).tolist()
        missing = sum(stamp not in states or stamp not in poses for stamp in stamps)
        if missing:
            raise Failure(f'{missing} of {len(stamps)} states are missing')
        true = np.array([poses[stamp] for stamp in stamps])
        rotation = np.moveaxis(np.reshape(from_quaternion(*true[:, 3:].T), (3, 3, -1)), -1, 0)
        turned = desired.rotation.swapaxes(1, 2) @ rotation
        # By the sine: the cosine does not resolve angles below 1e-8.
        sine = 0.5 * np.linalg.norm(turned[:, [2, 0, 1], [1, 2, 0]]
                                    - turned[:, [1, 2, 0], [2, 0, 1]], axis=1)
        return Errors(
            times * 1e-9, 1e6 * (np.array([states[stamp] for stamp in stamps]) - lengths),
            1e6 * np.linalg.norm(true[:, :3] - desired.position, axis=1),
            1e6 * np.arcsin(np.minimum(sine, 1.0)))


def stamp_of(message: bytes) -> int:
    """Return the stamp of any message with a header, from this computer [ns]."""
    sec, nanosec = struct.unpack_from('<iI', message, 4)
    return int(sec) * 1_000_000_000 + int(nanosec)


class Program:
    """One of the programs, in its own process."""

    def __init__(self, name: str, command: Sequence[str | Path], folder: Path) -> None:
        self.name = name
        self._output = folder / f'{name}.txt'
        with self._output.open('wb') as output:
            self._process = subprocess.Popen(
                command, stdout=output, stderr=output, stdin=subprocess.DEVNULL)

    def last_line(self, without: str = '\n') -> str:
        """Return the last line that it has printed, of those without some words."""
        lines = self._output.read_text(errors='replace').splitlines()
        return ([line for line in lines if without not in line] or ['no output'])[-1]

    def check(self) -> None:
        """Raise Failure if it has ended, unless the reference motion is complete."""
        code = self._process.poll()
        if code or (code == 0 and self.name != 'stewart_trajectory'):
            # It waits for others at each start: that is not why it has ended.
            line = self.last_line(without='time stands still')
            raise Failure(f'{self.name} ended with exit code {code}: {line}')

    def stop(self) -> None:
        """Terminate it, if it still runs."""
        self._process.terminate()

    def wait(self) -> None:
        """Wait until it has ended."""
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def simulate(commands: Mapping[str, Sequence[str | Path]], files: Mapping[str, Sequence[Path]],
             given: Mapping[str, Any], recorder: Recorder, end: int,
             progress: Callable[[int], object]) -> None:
    """
    Run programs until the simulated time has come to its end, and record the measured states.

    Parameters
    ----------
    commands : mapping of str to sequence
        Commands by the name of the program; the last one is started when the others are connected.
    files : mapping of str to sequence of Path
        Their parameter files.
    given : mapping
        Further parameters, as in a file.
    recorder : Recorder
        Is destroyed.
    end : int
        [ns] since the start.
    progress : callable
        Called with the simulated time [ns].

    """
    executor = EventsExecutor()
    executor.add_node(recorder)
    programs: list[Program] = []

    def until(done: Callable[[], bool]) -> None:
        reached, since, looked = 0, time.monotonic(), 0.0
        while not done():
            executor.spin_once(timeout_sec=LOOK)
            now = time.monotonic()
            if now - looked < LOOK:
                continue
            looked = now
            for program in programs:
                program.check()
            if reached != (reached := recorder.time):
                since = now
                progress(reached)
            if now - since > PATIENCE:
                raise Failure(f'no progress at {reached * 1e-9:.3f} s; ' + '; '.join(
                    f'{each.name}: {each.last_line()}' for each in programs))

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'given.yaml'
        file.write_text(yaml.safe_dump(given), encoding='utf-8')
        try:
            for n, (name, command) in enumerate(commands.items(), start=1):
                if n == len(commands):
                    until(recorder.ready)
                arguments = [part for path in (*files.get(name, ()), file)
                             for part in ('--params-file', path)]
                programs.append(Program(name, [
                    *command, *([] if '--ros-args' in command else ['--ros-args']), *arguments],
                    Path(folder)))
            until(lambda: recorder.time >= end)
        finally:
            for program in programs:
                program.stop()
            for program in programs:
                program.wait()
            executor.shutdown()
            recorder.destroy_node()
    progress(end)


def leg_mass(platform: StewartPlatform, motion: Motion) -> float:
    """Return the mass that one leg moves alone [kg, kg m^2], the mean of the six."""
    to_legs = np.linalg.inv(platform.drive_jacobian(motion))
    masses = to_legs.T @ platform.mass_matrix(motion) @ to_legs
    return float(np.mean(np.diag(masses)))


@contextmanager
def demonstration(command: str) -> Iterator[None]:
    """Give ROS programs a domain of their own, and end with one line where something fails."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    try:
        yield
    except (Failure, StewartError, OSError) as exc:
        raise SystemExit(f'{command}: {exc}') from None
    except (KeyboardInterrupt, ExternalShutdownException):
        raise SystemExit(130) from None
    finally:
        rclpy.try_shutdown()


@contextmanager
def live_view() -> Iterator[None]:
    """Run examples/live_view.py, print its address, and open it where there is a browser."""
    # Where it fails it says why on stderr, and the demo goes on without it.
    view = subprocess.Popen([sys.executable, ROOT / 'examples' / 'live_view.py', '--port', '0'],
                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    try:
        assert view.stdout is not None
        if address := view.stdout.readline().strip():
            print(f'the hexapod in motion: {address} (as long as the demo runs)', flush=True)
            open_browser(address)
        yield
    finally:
        view.terminate()
        view.communicate()


def open_browser(address: str) -> None:
    """
    Open a page in the browser of a user who has a screen, without waiting for it.

    Nothing is opened where the output is not a terminal. In a session of its own, so that neither
    Ctrl-C ends a browser nor one without windows takes the terminal.
    """
    if sys.stdout.isatty() and (sys.platform == 'darwin' or os.environ.get('DISPLAY')
                                or os.environ.get('WAYLAND_DISPLAY')):
        subprocess.Popen([sys.executable, '-m', 'webbrowser', address], start_new_session=True,
                         stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                         stderr=subprocess.DEVNULL)


class Progress:
    """
    Shows the simulated time of all runs: a bar on a terminal, else a line for each stage.

    Parameters
    ----------
    seconds : float
        Simulated time of all stages [s].

    """

    def __init__(self, seconds: float) -> None:
        self._bar = tqdm(total=seconds, unit='s', ncols=79, mininterval=0.5, disable=None,
                         bar_format='{desc} {bar} {n:.1f} of {total:.1f} s')
        self._done = self._stage = 0.0
        self._begun = time.monotonic()
        self._pace = PACE

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bar."""
        self._bar.close()

    def stage(self, text: str, seconds: float) -> None:
        """Begin a stage of this simulated time; it takes as long as the previous one."""
        now = time.monotonic()
        if self._stage:
            self._pace = (now - self._begun) / self._stage
        self._done, self._stage, self._begun = self._done + self._stage, seconds, now
        self._bar.set_description_str(text)
        if self._bar.disable:
            print(f'{text}: {seconds:g} s of motion, about {self._pace * seconds:.0f} s',
                  flush=True)

    def reached(self, nanoseconds: int) -> None:
        """Show the simulated time of this stage [ns]."""
        shown = self._done + min(nanoseconds * 1e-9, self._stage)
        self._bar.update(max(shown - self._bar.n, 0.0))

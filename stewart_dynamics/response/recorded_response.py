# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The part ``response`` of summary.json: how the platform of a bag follows its setpoints.

Achieved poses are measured, or those of measured legs by forward kinematics. The six axes are the
position of the platform's origin and the rotation vector from the mean orientation, base axes.
All samples are kept until the end: 200 bytes for each setpoint and measured sample.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from msgspec.structs import asdict
import numpy as np

from stewart_dynamics.arrays import Array, Integers, Records, Stamps
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import to_rotation_vector
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.rows import MOTION, POSE, POSITION, ROTATION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.joint_state import JointStateReader, NUMBERS_END
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.response.axes_response import AXES, axes_response, legs_response
from stewart_dynamics.response.clock_alignment import aligned, overlaps
from stewart_dynamics.response.even_samples import (
    at_even_times, check_overlap, clock_notices, Runs, Track, Tracks, without_frozen)
from stewart_dynamics.response.frequency_response import signal_module
from stewart_dynamics.response.response_measures import COHERENT
from stewart_dynamics.response.response_record import (
    AxesResponse, LegBalance, LegResponse, RecordedResponses)
from stewart_dynamics.setpoints import input_messages as inputs
from stewart_dynamics.setpoints.input_messages import SampleReader
from stewart_dynamics.setpoints.rejections import OUT_OF_RANGE, Rejections
from stewart_dynamics.setpoints.step import Batch

MEASURED, MEASURED_POSE = 'measured', 'measured_pose'
# Slow motion that is smaller or larger by these factors has another unit; a degree is 0.0175 rad.
_SMALLEST, _LARGEST = 0.025, 20.0
NO_POSE = 'no pose has these'  # positions of the drives


class Followed(NamedTuple):
    """How a platform follows, and the samples that plots show."""

    values: RecordedResponses
    samples: Runs  # of the six axes


class RecordedResponse:
    """
    Collects setpoints and measured legs or poses, and analyzes them at the end.

    topics: in the bag, by MEASURED or MEASURED_POSE.
    reject: called with topic, reason, details and number of messages that are rejected.

    Raises StewartError where SciPy is not installed.
    """

    def __init__(self, parameters: Parameters, topics: Mapping[str, str],
                 reject: Callable[[str, str, str, int], None]) -> None:
        signal_module()
        self._parameters, self._reject = parameters, reject
        self._platform = StewartPlatform(parameters)
        self.key = MEASURED_POSE if MEASURED_POSE in topics else MEASURED
        self._topic = topics[self.key]
        self._legs = JointStateReader(parameters.joints, ['position'])
        self._rejections = Rejections(
            lambda rejection, details: reject(self.key, rejection.reason, details, 1))
        self._poses = SampleReader(inputs.POSE, parameters.base_frame, self._rejections)
        self._commanded = Tracks(12)
        self._measured = Tracks(6 if self.key == MEASURED else 12)
        self.notices: list[str] = []
        self._own_clock = False

    def add(self, setpoints: Batch) -> None:
        """Add setpoints."""
        self._commanded.add(setpoints.stamps, setpoints.motions[:, POSE], setpoints.times)

    def read_messages(self, messages: Messages) -> None:
        """Add messages of the measured legs or poses."""
        if self.key == MEASURED:
            self._take_legs(messages)
        else:
            self._take_poses(messages)

    def _take_legs(self, messages: Messages) -> None:
        states = self._legs.read_states(messages)
        for reason, number in states.rejected.items():
            self._reject(self.key, reason, '', number)
        if not len(states.stamps):
            return
        sound = (np.abs(states.values) < NUMBERS_END).all(axis=1)
        if not sound.all():
            self._reject(self.key, OUT_OF_RANGE, '', int(np.count_nonzero(~sound)))
        self._measured.add(states.stamps[sound], states.values[sound],
                           messages.times[states.places[sound]])

    def _take_poses(self, messages: Messages) -> None:
        poses = self._poses.read_samples(messages)
        if len(poses.stamps):
            self._measured.add(poses.stamps, poses.values, messages.times[poses.places])

    def take_poses(self, stamps: Stamps, poses: Array) -> None:
        """Add achieved poses (N, 12) of a file, whose clock may be another one."""
        self._own_clock = True
        self._measured.add(stamps, poses, stamps)

    def finish(self) -> Followed:
        """
        Return the response.

        Raises StewartError if there are too few samples, or they are not of the same time.
        """
        if self.key == MEASURED:
            self._legs.check(self._topic)
        commanded, measured = self._commanded.track(), self._measured.track()
        for tracks, name in ((self._commanded, 'setpoints'), (self._measured, self._topic)):
            if tracks.left_out:
                self.notices.append(f'response: {tracks.left_out} samples of {name} are left out: '
                                    'their stamps do not increase')
        shift = None
        if self._own_clock and min(len(each.stamps) for each in (commanded, measured)) > 1 and (
                not overlaps(commanded, measured)):
            measured, shift = aligned(commanded, measured, self._topic)
            self.notices.append(
                f'{self._topic}: has another clock than the setpoints: its times are shifted by '
                f'{shift:.6g} s, where the speeds correlate best: delays are not known, phases '
                'and bandwidths at 90 degrees are those without the mean delay')
        check_overlap(commanded, measured, self._topic)
        measured, frozen = without_frozen(measured, commanded)
        if frozen:
            self.notices.append(f'response: {frozen} samples of {self._topic} are left out: they '
                                'repeat the one before while the setpoints move')
        timeout = self._parameters.setpoint.timeout
        legs: dict[str, LegResponse] = {}
        balance: LegBalance | None = None
        if self.key == MEASURED:
            measured = measured._replace(
                values=measured.values + self._parameters.geometry.zero_length)
            positions = commanded._replace(values=self._platform.inverse_kinematics(
                Pose(commanded.values[:, POSITION],
                     commanded.values[:, ROTATION].reshape(-1, 3, 3))))
            own = at_even_times(positions, measured, timeout)
            if own.runs:
                legs, balance = legs_response(own, self._parameters.joints)
            measured, lost = achieved_poses(self._platform.structure, measured, commanded)
            if lost:
                named = self._parameters.leg_kind.position.field
                self._reject(self.key, f'{NO_POSE} {named}', '', lost)
            check_overlap(commanded, measured, self._topic)
        axes_commanded, axes_achieved = (
            each._replace(values=axes_of(each.values, mean_orientation(each.values)))
            for each in (commanded, measured))
        samples = at_even_times(axes_commanded, axes_achieved, timeout)
        if not samples.runs:
            raise StewartError(f'response: setpoints and {self._topic} have no time without a gap '
                               'in common that is long enough')
        size = self._parameters.singularity.characteristic_length
        axes = axes_response(samples, size)
        if shift is not None:
            for axis in axes.axes.values():
                axis.delay = None
        self.notices += clock_notices(commanded, measured, self._topic, [
            axis.delay for axis in axes.axes.values() if axis.delay is not None],
            axes.clock_drift)
        self.notices += [
            f'{self._topic}: {name} moves opposite to its setpoints: the sign of an axis differs'
            for name, axis in axes.axes.items() if axis.opposite]
        self.notices += _unit_notices(axes, self._topic)
        return Followed(RecordedResponses(
            **asdict(axes), legs=legs, leg_balance=balance, topic=self._topic,
            samples=len(measured.stamps), rate=samples.rate,
            highest_frequency=samples.highest), samples)


def _unit_notices(axes: AxesResponse, topic: str) -> list[str]:
    """Return notices of shifts and of turns whose scale at low frequencies no drive has."""
    notices = []
    for names, words in ((AXES[:3], 'lengths in m'), (AXES[3:], 'angles in rad')):
        off = {}
        for name in names:
            axis = axes.axes[name]
            gain = next((gain for gain, coherence in zip(axis.gain, axis.coherence, strict=True)
                         if coherence >= COHERENT), 1.0)
            if axis.reason is None and not _SMALLEST < gain < _LARGEST:
                off[name] = gain
        if off:
            notices.append(
                f'{topic}: slow motion of {", ".join(off)} is {next(iter(off.values())):.3g} '
                f'times that of the setpoints: likely another unit of {words}')
    return notices


def axes_of(poses: Array, center: Array) -> Array:
    """Return the six axes (N, 6) [m, rad] of rows of poses (N, 12) about an orientation (3, 3)."""
    turns = poses[:, ROTATION].reshape(-1, 3, 3) @ center.T
    return np.hstack([poses[:, POSITION], to_rotation_vector(turns)])


def mean_orientation(poses: Array) -> Array:
    """Return the mean orientation (3, 3) of rows of poses (N, 12)."""
    left, _, right = np.linalg.svd(poses[:, ROTATION].reshape(-1, 3, 3).mean(axis=0))
    flip = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    found: Array = left @ flip @ right
    return found


def achieved_poses(structure: Records, measured: Track, commanded: Track) -> tuple[Track, int]:
    """
    Return the poses (N, 12) of measured drives by forward kinematics, begun at commanded poses.

    The number of samples without a pose, which are left out, is returned too.

    structure: of the hexapod. measured: positions of the drives (N, 6), as lengths [m]. commanded:
        rows of poses (M, 12).
    """
    rows = np.zeros((len(measured.stamps), MOTION))
    nearest = np.searchsorted(commanded.stamps, measured.stamps).clip(0, len(commanded.stamps) - 1)
    rows[:, POSE] = commanded.values[nearest]
    codes: Integers = np.empty(len(rows), dtype=np.int64)
    forward_kinematics.poses(structure, np.ascontiguousarray(measured.values), rows, codes,
                             np.empty_like(codes), np.empty(len(rows)))
    found = codes == forward_kinematics.FOUND
    return (Track(measured.stamps[found], rows[found, POSE], measured.late),
            int(np.count_nonzero(~found)))

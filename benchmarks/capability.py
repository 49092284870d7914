# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Capability: answers compared with independent computations, and the time they take.

Run by hand, ``make bench-capability``; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

from inverse_dynamics import Array, markdown, write
import numpy as np
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from stewart_dynamics import Capability, Motion, Pose, StewartPlatform
from stewart_dynamics.capability.motions import faster
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / 'test'))
from referees import rng, size_of  # noqa: E402, I100
from test_capability import limited, random_travel  # noqa: E402
import test_capability_boxes as boxes  # noqa: E402
from test_leg_clearance import near, SHAPE  # noqa: E402, I100

BEGIN, END = '<!-- capability: begin -->', '<!-- capability: end -->'
PLATFORM = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')


def wrenches(number: int) -> str:
    """Return the largest |max|f| / f_max - 1| of wrenches at the limit."""
    worst = 0.0
    for seed in range(number):
        platform, pose = limited(rng(seed))
        direction = rng(seed).normal(size=6)
        found = Capability(platform).wrench(pose, direction)
        forces = platform.inverse_dynamics(
            Motion.from_pose(pose), wrench=-found.value * direction).forces
        worst = max(worst, abs(float(
            (np.abs(forces) / platform.parameters['limits.force_max']).max()) - 1.0))
    return f'{worst:.1e}'


def travels(number: int) -> str:
    """Return the largest excess of a length at 1e5 steps, and the last one's distance from it."""
    worst, gap, ended = -1.0, 0.0, 0
    for seed in range(number):
        random = rng(seed)
        platform, pose = limited(random)
        p = platform.parameters
        direction, pivot = random_travel(random, size_of(p))
        found = Capability(platform).travel(pose, direction, pivot)
        by = np.linspace(0.0, found.value, 100_000)[:, None]
        rotations = Rotation.from_rotvec(by * direction[3:]).as_matrix() @ pose.rotation
        lengths = platform.inverse_kinematics(Pose(
            pose.position + pose.rotation @ pivot + by * direction[:3] - rotations @ pivot,
            rotations))
        worst = max(worst, float((lengths / p['limits.length_max']).max()) - 1.0,
                    1.0 - float((lengths / p['limits.length_min']).min()))
        if found.limit in ('length_min', 'length_max'):
            bound = p[f'limits.{found.limit}'][found.leg]
            gap = max(gap, abs(float(lengths[-1, found.leg] - bound)))
            ended += 1
    return f'{worst:.1e}; {gap:.1e} at the end of {ended}'


def recorded(name: str) -> tuple[Array, Motion]:
    """Return times and samples of a recorded motion with all three topics."""
    kinds: dict[str, dict[int, list[float]]] = {'pose': {}, 'twist': {}, 'accel': {}}
    with AnyReader([ROOT / 'bags' / name]) as bag:
        for connection, _, data in bag.messages():
            kind = connection.topic.rsplit('/', 1)[-1]
            if '/setpoint/' not in connection.topic or kind not in kinds:
                continue
            message = bag.deserialize(data, connection.msgtype)
            stamp = message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec
            value = getattr(message, kind)
            parts = (value.position, value.orientation) if kind == 'pose' else (
                value.linear, value.angular)
            kinds[kind][stamp] = [getattr(part, axis) for part in parts for axis in 'xyzw'
                                  if hasattr(part, axis)]
    stamps = sorted(set.intersection(*map(set, kinds.values())))
    pose, twist, accel = (np.array([each[stamp] for stamp in stamps]) for each in kinds.values())
    return (np.array(stamps) - stamps[0]) * 1e-9, Motion.from_quaternion(
        pose[:, :3], pose[:, 3:], twist[:, :3], twist[:, 3:], accel[:, :3], accel[:, 3:])


def factors(name: str) -> tuple[str, str]:
    """Return the speed factor of a recorded motion, and |ratio - 1| at it."""
    times, motion = recorded(name)
    found = Capability(PLATFORM).speed_factor(motion)
    begin = time.perf_counter()
    between = Capability(PLATFORM).speed_factor(motion, times=times)
    took = time.perf_counter() - begin
    if found.value == 0.0:
        leg = f', leg {found.leg + 1}' if found.leg >= 0 else ''
        return f'0 ({found.limit}{leg})', 'exceeded at any speed'
    solved = PLATFORM.inverse_dynamics(Motion.of_rows(faster(motion.rows, found.value)))
    p = PLATFORM.parameters
    ratio = max(float((np.abs(solved.rates) / p['limits.velocity_max']).max()),
                float((np.abs(solved.forces) / p['limits.force_max']).max()))
    return (f'{found.value:.6f} ({found.limit}, leg {found.leg + 1}); between the samples, too: '
            f'{between.value:.6f}, {took:.2f} s', f'{abs(ratio - 1.0):.1e}')


def reachable(number: int, poses: int) -> list[tuple[str, str]]:
    """Return rows: wrong answers, and times of a proof and of a factor."""
    wrong, certain, proofs, growths = 0, 0, [], []
    for seed in range(number):
        platform, pose, box, pivot = boxes.case(seed)
        capability, random = Capability(platform), rng(seed)
        begin = time.perf_counter()
        factor = capability.reachable_factor(box, pose, pivot).value
        growths.append(time.perf_counter() - begin)
        box = box * (factor or 0.1) * random.choice([0.9, 1.0, 1.0 + 1e-6, 1.1])
        begin = time.perf_counter()
        answer = capability.reachable(box, pose, pivot)
        proofs.append(time.perf_counter() - begin)
        certain += answer.certain
        side = platform.inverse_dynamics(Motion.from_pose(pose)).determinant
        if not answer.certain:
            at_worst = boxes.excesses(platform, Pose(
                answer.worst.pose.position[None], answer.worst.pose.rotation[None]), side)
            wrong += answer.worst.excess > 0.0 and not boxes.outside(platform, at_worst).any()
            continue
        for _ in range(poses // boxes.SAMPLES):
            found = boxes.excesses(platform, boxes.poses_in(box, pose, pivot, random), side)
            if boxes.outside(platform, found).any():
                wrong += 1
                break
    return [(f'boxes against {poses:,} poses: wrong of {number} ({certain} reachable)',
             f'{wrong}'),
            ('proof of a box: median, largest (ms)',
             f'{1e3 * np.median(proofs):.2f}, {1e3 * max(proofs):.0f}'),
            ('factor of a box: median, largest (ms)',
             f'{1e3 * np.median(growths):.1f}, {1e3 * max(growths):.0f}')]


def clearances(number: int) -> list[tuple[str, str]]:
    """Return rows: time of a clearance, and of the factor of a box that a clearance limits."""
    corners = 0.8 * np.exp(1j * np.pi / 4.0 * np.arange(8))
    outline = np.stack([corners.real, corners.imag, np.full(8, -0.05)], axis=1)
    rows = []
    for name, plates in (('', {}), (', with two plates of eight corners', {
            'geometry.base_outline': outline * [1.5, 1.5, 0.0],
            'geometry.platform_outline': outline})):
        measure = LegClearance(PLATFORM.parameters.replaced({**SHAPE, **plates}))
        motions = Motion.from_pose(boxes.poses_in(
            np.ones((6, 2)) * [-0.1, 0.1], PLATFORM.home_pose(), np.zeros(3), rng())).rows
        took = []
        for _ in range(20):
            begin = time.process_time()
            measure(motions)
            took.append((time.process_time() - begin) / len(motions))
        rows.append((f'clearance of a sample{name}: least, median (us)',
                     f'{1e6 * min(took):.2f}, {1e6 * np.median(took):.2f}'))
    growths = []
    for seed in range(number):
        platform, pose, random = near(seed)
        box = np.stack([-random.uniform(0.1, 1.0, 6), random.uniform(0.1, 1.0, 6)], axis=1)
        begin = time.process_time()
        found = Capability(platform).reachable_factor(box, pose)
        if found.limit == 'leg_clearance_min':
            growths.append(time.process_time() - begin)
    return [*rows, (f'factor of a box that a clearance limits, {len(growths)} boxes: median, '
                    'largest (ms)', f'{1e3 * np.median(growths):.0f}, {1e3 * max(growths):.0f}')]


def times_of_travel() -> list[tuple[str, str]]:
    """Return rows: time of twelve travels at one pose, and at many poses."""
    capability, home = Capability(PLATFORM), PLATFORM.home_pose()
    sides = np.concatenate([np.eye(6), -np.eye(6)])
    took = []
    for _ in range(200):
        begin = time.perf_counter()
        capability.travel(home, sides)
        took.append(time.perf_counter() - begin)
    poses = boxes.poses_in(np.ones((6, 2)) * [-0.1, 0.1], home, np.zeros(3), rng())
    many = Pose(np.tile(poses.position, (5, 1))[:, None], np.tile(
        poses.rotation, (5, 1, 1))[:, None])
    begin, used = time.perf_counter(), time.process_time()
    capability.travel(many, sides)
    return [('12 travels at one pose: least, median (us)',
             f'{1e6 * min(took):.0f}, {1e6 * np.median(took):.0f}'),
            ('12 travels at 100,000 poses (s; of all processors)',
             f'{time.perf_counter() - begin:.2f}; {time.process_time() - used:.2f}')]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--hexapods', type=int, default=1000, help='(%(default)s)')
    parser.add_argument('--boxes', type=int, default=200, help='(%(default)s)')
    parser.add_argument('--poses', type=int, default=1_000_000, help='of a box (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the table into README.md')
    options = parser.parse_args()
    if min(options.hexapods, options.boxes, options.poses) < 1:
        parser.error('--hexapods, --boxes and --poses must be at least 1')
    rows: list[tuple[str, ...]] = [('figure', 'measured')]
    rows.append((f'static wrench at the limit, {options.hexapods} hexapods: |max f / f_max - 1|',
                 wrenches(options.hexapods)))
    rows.append(('travel at 100,000 steps, 100 hexapods: largest relative excess of a length; '
                 'from the limit at the end (m)',
                 travels(100)))
    for name in ('clear', 'singular'):
        factor, ratio = factors(name)
        rows += [(f'speed factor of bags/{name}', factor), ('|ratio - 1| at it', ratio)]
    rows += times_of_travel()
    rows += clearances(options.boxes // 4)
    rows += reachable(options.boxes, options.poses)
    lines = ['', *markdown(rows), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()

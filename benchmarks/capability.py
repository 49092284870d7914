# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Capability: answers compared with independent computations, and the time they take.

Run by hand, ``make bench-capability``; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time
from typing import Any

from inverse_dynamics import Array, markdown, processor_name, write
import numpy as np
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from stewart_dynamics import Capability, Motion, Pose, StewartPlatform
from stewart_dynamics.capability.motions import faster
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, Limits

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / 'test'))
from referees import rng, size_of  # noqa: E402, I100
from test_capability import limited, random_travel  # noqa: E402
import test_capability_boxes as boxes  # noqa: E402
from test_leg_clearance import near, SHAPE  # noqa: E402, I100

Rows = list[tuple[str, str]]

PLATFORM = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')
HOME = PLATFORM.home_pose()
SIDES = np.concatenate([np.eye(6), -np.eye(6)])
CUBE = np.ones((6, 2)) * [-0.1, 0.1]
_CORNERS = 0.8 * np.exp(1j * np.pi / 4.0 * np.arange(8))
OUTLINE = np.stack([_CORNERS.real, _CORNERS.imag, np.full(8, -0.05)], axis=1)
SHAPED = StewartPlatform(PLATFORM.parameters.replaced({**SHAPE, CLEARANCE_MIN: 0.02}))
PLATED = StewartPlatform(SHAPED.parameters.replaced({
    'geometry.base_outline': (OUTLINE * [1.5, 1.5, 0.0]).ravel(),
    'geometry.platform_outline': OUTLINE.ravel()}))
SHAPES = {'': PLATFORM, ', with a clearance of the legs': SHAPED,
          ', with plates of eight corners': PLATED}
FREE = StewartPlatform(PLATFORM.parameters.replaced({
    'limits.length_min': None, 'limits.length_max': None}))
"""Only singularities limit it."""


def processor_times(function: Callable[[], Any], turns: int) -> Array:
    """Return the processor times of calls [s], after one that is not measured."""
    function()
    found: Array = np.empty(turns)
    for turn in range(turns):
        begin = time.process_time()
        function()
        found[turn] = time.process_time() - begin
    return found


def least_and_median(times: Array) -> str:
    """Return two times [us] as text."""
    return f'{1e6 * times.min():.3g}, {1e6 * np.median(times):.3g}'


def median_and_largest(times: Sequence[float]) -> str:
    """Return two times [ms] as text."""
    return f'{1e3 * np.median(times):.3g}, {1e3 * max(times):.4g}'


# Answers

def wrenches(options: argparse.Namespace) -> Rows:
    """Apply wrenches at the limit in the inverse dynamics."""
    worst = 0.0
    for seed in range(options.hexapods):
        platform, pose = limited(rng(seed))
        direction = rng(seed).normal(size=6)
        found = Capability(platform).wrench(pose, direction)
        forces = platform.inverse_dynamics(
            Motion.from_pose(pose), wrench=-found.value * direction).forces
        worst = max(worst, abs(float(
            (np.abs(forces) / platform.parameters.limits.force_max).max()) - 1.0))
    return [(f'static wrench at the limit, {options.hexapods} hexapods: max f / f_max, from 1',
             f'{worst:.1e}')]


def travels(options: argparse.Namespace) -> Rows:
    """Return by how much travels exceed a limit at any of 100,000 steps, and at their ends."""
    ends: dict[str, list[float]] = {}
    worst = -1.0
    for seed in range(options.travels):
        platform, pose, _, _ = boxes.case(seed) if seed % 5 else (*near(seed)[:2], None, None)
        random = rng(seed)
        direction, pivot = random_travel(random, size_of(platform.parameters))
        found = Capability(platform).travel(pose, direction, pivot)
        if not 0.0 < found.value < np.inf:
            continue
        by = np.linspace(0.0, found.value, 100_000)[:, None]
        rotations = Rotation.from_rotvec(by * direction[3:]).as_matrix() @ pose.rotation
        excesses = relative_excesses(platform, Pose(
            pose.position + pose.rotation @ pivot + by * direction[:3] - rotations @ pivot,
            rotations), pose)
        worst = max(worst, *(float(each.max()) for each in excesses.values()))
        at_end = excesses[found.limit][-1]
        ends.setdefault(found.limit, []).append(abs(float(at_end[max(found.leg, 0)])))
    return [(f'travel, {options.travels} hexapods: largest excess of a limit at 100,000 steps, '
             'part of it', f'{worst:.1e}'),
            ('from the limit at the end, part of it', '; '.join(
                f'{name} {max(values):.0e} ({len(values)})'
                for name, values in sorted(ends.items())))]


def relative_excesses(platform: StewartPlatform, poses: Pose, start: Pose) -> dict[str, Array]:
    """Return by how much poses exceed each limit, as parts of it."""
    side = platform.inverse_dynamics(Motion.from_pose(start)).determinant
    found = boxes.excesses(platform, poses, side)
    sizes = {name.removeprefix('limits.'): bound for name, bound in Limits(
        platform.parameters).bounds.items()}
    if 'leg_clearance_min' in sizes:
        clearances = LegClearance(platform.parameters)(Motion.from_pose(poses).rows)
        found['leg_clearance_min'] = sizes['leg_clearance_min'] - clearances
        # a clearance may have to be 0
        sizes['leg_clearance_min'] = size_of(platform.parameters)
    sizes['singularity'] = platform.parameters.singularity.stop_condition
    return {name: excess / sizes[name] for name, excess in found.items()}


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


def speeds(_options: argparse.Namespace) -> Rows:
    """Play recorded motions as fast as they can be."""
    p, rows = PLATFORM.parameters, []
    for name in ('clear', 'singular'):
        times, motion = recorded(name)
        found = Capability(PLATFORM).speed_factor(motion)
        if found.value == 0.0:
            rows.append((f'speed factor of bags/{name}', f'0 ({found.limit})'))
            continue
        between = Capability(PLATFORM).speed_factor(motion, times=times)
        solved = PLATFORM.inverse_dynamics(Motion.of_rows(faster(motion.rows, found.value)))
        ratio = max(float((np.abs(solved.rates) / p.limits.velocity_max).max()),
                    float((np.abs(solved.forces) / p.limits.force_max).max()))
        rows += [(f'speed factor of bags/{name}', f'{found.value:.6f} ({found.limit}, leg '
                  f'{found.leg + 1}); between the samples, too: {between.value:.6f}'),
                 ('largest part of a limit at it, from 1', f'{abs(ratio - 1.0):.1e}')]
    return rows


def reachable(options: argparse.Namespace) -> Rows:
    """Compare boxes with random poses of them."""
    wrong = certain = 0
    for seed in range(options.boxes):
        platform, pose, box, pivot = boxes.case(seed)
        capability, random = Capability(platform), rng(seed)
        factor = capability.reachable_factor(box, pose, pivot).value
        box = box * (factor or 0.1) * random.choice([0.9, 1.0, 1.0 + 1e-6, 1.1])
        answer = capability.reachable(box, pose, pivot)
        certain += answer.certain
        wrong += is_wrong(platform, pose, answer, partial(
            boxes.poses_in, box, pose, pivot, random), options.poses)
    return [(f'boxes against {options.poses:,} poses of each: wrong of {options.boxes} '
             f'({certain} reachable)', f'{wrong}')]


def clear(options: argparse.Namespace) -> Rows:
    """Compare boxes that a clearance limits with random poses of them."""
    wrong = certain = number = 0
    poses = max(options.poses // 10, 1)
    for seed in range(options.boxes // 4):
        platform, pose, random = near(seed)
        box = boxes.some_ranges(random)
        found = Capability(platform).reachable_factor(box, pose)
        if found.limit != 'leg_clearance_min' or found.value == 0.0:
            continue
        box = box * found.value * random.choice([0.9, 1.0, 1.1])
        answer = Capability(platform).reachable(box, pose)
        number, certain = number + 1, certain + answer.certain
        wrong += is_wrong(platform, pose, answer, partial(
            boxes.poses_in, box, pose, np.zeros(3), random), poses)
    return [(f'boxes that a clearance limits, of legs and plates, against {poses:,} poses: wrong '
             f'of {number} ({certain} reachable)', f'{wrong}')]


def is_wrong(platform: StewartPlatform, pose: Pose, answer: Any, sample: Callable[[], Pose],
             poses: int) -> bool:
    """Return whether poses of a box contradict the answer about it."""
    def outside(poses: Pose) -> bool:
        return any(float(each.max()) > 1e-9
                   for each in relative_excesses(platform, poses, pose).values())

    if not answer.certain:
        worst = answer.worst.pose
        return bool(answer.worst.excess > 0.0) and not outside(
            Pose(worst.position[None], worst.rotation[None]))
    return any(outside(sample()) for _ in range(-(-poses // boxes.SAMPLES)))


# Times

def times_of_travel(_options: argparse.Namespace) -> Rows:
    """Measure twelve travels at one pose, and at many poses."""
    rows = [(f'12 travels at one pose{name}: least, median (us)', least_and_median(
        processor_times(partial(Capability(platform).travel, HOME, SIDES),
                        20 if platform is PLATED else 200)))
            for name, platform in {**SHAPES, ', all to a singularity': FREE}.items()]
    poses = boxes.poses_in(CUBE, HOME, np.zeros(3), rng())
    many = Pose(np.tile(poses.position, (5, 1))[:, None],
                np.tile(poses.rotation, (5, 1, 1))[:, None])
    begin, used = time.perf_counter(), time.process_time()
    Capability(PLATFORM).travel(many, SIDES)
    took, used = time.perf_counter() - begin, time.process_time() - used
    return [*rows, ('12 travels at 100,000 poses (s); elapsed',
                    f'{used:.2f}; {took:.2f}')]


def times_of_clearance(_options: argparse.Namespace) -> Rows:
    """Measure the clearance of many poses."""
    motions = Motion.from_pose(boxes.poses_in(CUBE, HOME, np.zeros(3), rng())).rows
    return [(f'clearance of a sample{name}: least, median (us)', least_and_median(processor_times(
        partial(LegClearance(platform.parameters), motions), 20) / len(motions)))
        for name, platform in list(SHAPES.items())[1:]]


def times_of_boxes(options: argparse.Namespace) -> Rows:
    """Measure proofs of boxes, and largest factors of boxes by their limits."""
    proofs: list[float] = []
    factors: dict[str, list[float]] = {}
    tight = 0
    for seed in range(options.boxes):
        platform, pose, box, pivot = boxes.case(seed)
        capability = Capability(platform)
        begin = time.process_time()
        found = capability.reachable_factor(box, pose, pivot)
        name = 'singularity' if found.limit == 'singularity' else 'length or joint'
        factors.setdefault(name, []).append(time.process_time() - begin)
        begin = time.process_time()
        capability.reachable(box * (found.value or 0.1), pose, pivot)
        proofs.append(time.process_time() - begin)
        if name == 'singularity':
            larger = capability.reachable(box * found.value * 1.002, pose, pivot)
            tight += not larger.certain and larger.worst.excess > 0.0
    for seed in range(options.boxes // 4):
        platform, pose, random = near(seed)
        box = boxes.some_ranges(random)
        begin = time.process_time()
        found = Capability(platform).reachable_factor(box, pose)
        if found.limit == 'leg_clearance_min':
            factors.setdefault('clearance', []).append(time.process_time() - begin)
    rows = [(f'proof of a box, {len(proofs)} boxes: median, largest (ms)',
             median_and_largest(proofs))]
    rows += [(f'factor of a box that a {name} limits, {len(times)} boxes: median, largest (ms)',
              median_and_largest(times)) for name, times in factors.items()]
    rows.append(('of those that a singularity limits, boxes larger by 0.2 % that are proven not '
                 'to be reachable', f'{tight}'))
    for name, platform in list(SHAPES.items())[1:]:
        capability = Capability(platform)
        times = processor_times(partial(capability.reachable, 0.2 * CUBE), 5)
        more = processor_times(partial(capability.reachable_factor, CUBE), 1)
        rows.append((f'proof and factor of a box{name} (ms)',
                     f'{1e3 * np.median(times):.3g}, {1e3 * more[0]:.4g}'))
    return rows


def times_of_datasheets(_options: argparse.Namespace) -> Rows:
    """Measure stewart_capability from its start to its end."""
    rows = []
    for name, platform in SHAPES.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / 'hexapod.yaml'
            platform.parameters.to_yaml(file)
            for _ in range(2):  # the first one may compile
                begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run([executable('stewart_capability'), '--params', file, '--output',
                                Path(folder) / 'datasheet', '--leg-stiffness', '5e7', '--force'],
                               check=True, capture_output=True)
                took = time.perf_counter() - begin
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            rows.append((f'whole datasheet with stiffness{name} (s); elapsed',
                         f'{used:.1f}; {took:.1f}'))
    return rows


TABLES: dict[str, dict[str, Callable[[argparse.Namespace], Rows]]] = {
    'answers': {'wrench': wrenches, 'travel': travels, 'speed': speeds, 'boxes': reachable,
                'clearance-boxes': clear},
    'times': {'travel-times': times_of_travel, 'clearance-times': times_of_clearance,
              'box-times': times_of_boxes, 'datasheet-times': times_of_datasheets}}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    sections = {name: [name] for table in TABLES.values() for name in table}
    sections |= {table: list(names) for table, names in TABLES.items()}
    parser.add_argument('--only', nargs='+', choices=sections, default=list(TABLES),
                        metavar='NAME', help=f'some of {", ".join(sections)} (all)')
    parser.add_argument('--hexapods', type=int, default=1000, help='(%(default)s)')
    parser.add_argument('--travels', type=int, default=100, help='(%(default)s)')
    parser.add_argument('--boxes', type=int, default=200, help='(%(default)s)')
    parser.add_argument('--poses', type=int, default=1_000_000, help='of a box (%(default)s)')
    parser.add_argument('--write', action='store_true',
                        help='put the tables that are whole into results/')
    options = parser.parse_args()
    if min(options.hexapods, options.travels, options.boxes, options.poses) < 1:
        parser.error('--hexapods, --travels, --boxes and --poses must be at least 1')
    chosen = {name for each in options.only for name in sections[each]}
    for table, names in TABLES.items():
        rows: list[tuple[str, ...]] = [(table, 'measured')]
        for name in [name for name in names if name in chosen]:
            begin = time.perf_counter()
            rows += names[name](options)
            print(f'{name}: {time.perf_counter() - begin:.0f} s', file=sys.stderr, flush=True)
        if len(rows) == 1:
            continue
        lines = ['', *markdown(rows), '', processor_name() + '.', '']
        print('\n'.join(lines))
        if options.write and chosen.issuperset(names):
            write(lines, *(f'<!-- capability {table}: {side} -->' for side in ('begin', 'end')))


if __name__ == '__main__':
    main()

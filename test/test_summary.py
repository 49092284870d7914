# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The summary of a motion, however its samples are split; and the table of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import json
import math
import re
import statistics
import tracemalloc
from typing import Any

from bag_summaries import bag_summary, motion_of
from checked_results import part_of
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng, ROOT, symmetric_parameters

from stewart_dynamics import Parameters
from stewart_dynamics.core.binding import places
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES
from stewart_dynamics.mechanics.rows import BASE, MOTION, NO_BASE
from stewart_dynamics.mechanics.singularity_warning import CAUSE, TIME, UNSOLVABLE_CONDITION
from stewart_dynamics.replay.residuals import AXES
from stewart_dynamics.replay.statements import cards
from stewart_dynamics.replay.summary import Answered, Summary
from stewart_dynamics.replay.summary_text import summary_lines
from stewart_dynamics.reporting.block_statistics import LISTED
from stewart_dynamics.setpoints.rejections import NOT_JOINED
from stewart_dynamics.setpoints.step import (
    Batch, Computed, FIRST, OUTPUT, Outputs, WARNING_STATE)
from stewart_dynamics.whole_file import to_json

Array = NDArray[np.float64]

SECOND = 1_000_000_000
RESTART, CLEARANCES = (places('stewart_output')[name] for name in ('restart', 'clearances'))
PUBLISHED = TELESCOPIC.published
JOINT_ANGLES = slice(CLEARANCES.start - 12, CLEARANCES.start)
LIMITS = {
    'limits.length_min': [0.5, 0.6, 0.7, 0.5, 0.6, 0.0],
    'limits.length_max': [1.5, 1.4, 1.3, 1.5, 1.4, 9.0],
    'limits.velocity_max': [0.9, 0.8, 0.7, 0.9, 0.8, 9.0],
    'limits.force_max': [90.0, 80.0, 70.0, 90.0, 80.0, 900.0],
    'limits.joint_force_max': [80.0, 90.0, 60.0, 95.0, 70.0, 800.0],
    'limits.base_joint_angle_max': [0.5, 0.4, 0.3, 0.5, 0.4, 3.0],
    'limits.platform_joint_angle_max': [0.9, 0.8, 0.7, 0.9, 0.8, 3.0],
    'limits.leg_clearance_min': 0.05, 'legs.cylinder.radius': 0.02, 'legs.cylinder.length': 0.4,
    'legs.piston.radius': 0.01}


def hexapod(**changes: Any) -> Parameters:
    """Return a hexapod whose first leg has a name with a blank."""
    return symmetric_parameters().replaced({
        'joints': ['front left', 'b', 'c', 'd', 'e', 'f'], 'setpoint.timeout': 0.5, **changes})


class Samples:
    """Samples of a motion for a summary; omitted values are ones."""

    def __init__(self, many: int, **given: Any) -> None:
        def numbers(name: str, *tail: int, default: float = 1.0) -> Array:
            values = np.empty((many, *tail))
            values[:] = given.pop(name, default)
            return values

        self.seconds = numbers('seconds', default=math.nan)
        if np.isnan(self.seconds).any():
            self.seconds = np.arange(many) * 1.0
        self.restarts = numbers('restarts', default=0.0) > 0.0
        self.stamps = np.round((1000.0 + self.seconds) * SECOND).astype(np.int64)
        self.lengths, self.rates = numbers('lengths', 6), numbers('rates', 6)
        self.demanded = numbers('demanded', 6)
        self.joint_forces = numbers('joint_forces', 6, default=0.5) * self.demanded
        self.forces = numbers('forces', 6, default=math.nan)
        self.forces = np.where(np.isnan(self.forces), self.demanded, self.forces)
        self.joint_angles = numbers('joint_angles', 12, default=0.1)
        self.clearances = numbers('clearances', 6, default=0.1)
        self.forces[numbers('suppressed', default=0.0) > 0.0] = math.nan
        self.unit_load = numbers('unit_load', 6)
        self.det, self.condition = numbers('det'), numbers('condition')
        self.time_to_crossing = numbers('time_to_crossing', default=math.inf)
        self.warnings = numbers('warnings', default=0.0) > 0.0
        self.breakdown = numbers('breakdown', len(SOURCES), 6) if 'breakdown' in given else None
        self.base_wrenches = numbers('base_wrenches', 6)
        self.base_unknown = numbers('base_unknown', default=0.0) > 0.0
        assert not given

    def outputs(self, parameters: Parameters) -> Outputs:
        """Return them as the step gives them: angles and clearances only if they have limits."""
        many = len(self.seconds)
        limited = parameters['limits.leg_clearance_min'] is not None
        rows = np.zeros((many, OUTPUT))
        rows[:, :TELESCOPIC.width] = np.concatenate([
            self.lengths, self.rates, self.demanded, self.det[:, None],
            np.zeros((many, 1)), self.condition[:, None], self.unit_load, self.joint_forces,
            ], axis=1)
        rows[:, PUBLISHED], rows[:, RESTART] = self.forces, self.restarts
        states = rows[:, WARNING_STATE]
        states[:, CAUSE], states[:, TIME] = self.warnings, self.time_to_crossing
        rows[:, JOINT_ANGLES], rows[:, CLEARANCES] = self.joint_angles, self.clearances
        outputs = Outputs(np.ones(many, dtype=bool), self.stamps, rows,
                          Computed.of(parameters, limited, limited), FIRST)
        np.testing.assert_array_equal(outputs.warnings, self.warnings)
        np.testing.assert_array_equal(outputs.times_to_crossing, self.time_to_crossing)
        return outputs

    def setpoints(self) -> Batch:
        """Return the setpoints; the base is still if it is always known."""
        many = len(self.seconds)
        bases = np.zeros((many, BASE))
        bases[self.base_unknown] = NO_BASE
        return Batch.from_parts(self.stamps, np.zeros((many, MOTION)), restarts=self.restarts,
                                bases=bases if self.base_unknown.any() else None)

    def parts(self, parameters: Parameters, edges: Sequence[int] = ()) -> Iterator[Answered]:
        """Return them as the replay gives them, in blocks with these edges."""
        outputs, setpoints = self.outputs(parameters), self.setpoints()
        with np.errstate(over='ignore'):
            powers = self.demanded * self.rates
        for first, end in zip([0, *edges], [*edges, len(self.seconds)], strict=True):
            part = slice(first, end)
            yield Answered(
                self.seconds[part], setpoints.chosen(part),
                part_of(outputs, part),
                self.base_wrenches[part], powers[part],
                None if self.breakdown is None else self.breakdown[part])

    def summary(self, parameters: Parameters, edges: Sequence[int] = (),
                quasi_static: bool = False) -> Summary:
        """Return the summary of them, given to it in parts."""
        summary = Summary(parameters, quasi_static)
        for part in self.parts(parameters, edges):
            summary.add_block(part)
        return summary


def table_of(samples: Samples, parameters: Parameters) -> str:
    """Return the summary for the terminal."""
    return '\n'.join(summary_lines(samples.summary(parameters).values()))


def values(many: int, **given: Any) -> dict[str, Any]:
    """Return what the summary of such samples has."""
    found = Samples(many, **given).summary(hexapod())
    to_json(found.values())
    return motion_of(found)


def singularity(many: int, **given: Any) -> dict[str, Any]:
    """Return the summary's part about singularities."""
    found: dict[str, Any] = values(many, **given)['singularity']
    return found


def random_samples(seed: int, many: int) -> Samples:
    """Return samples in which everything happens: restarts, gaps, zeros, nothing solved."""
    random = rng(seed)
    restarts = random.random(many) < 0.1
    steps = np.where(restarts, 0.0, random.choice([0.01, 0.02, 0.03, 0.7], many))
    unsolved = random.random(many) < random.choice([0.0, 0.2, 1.0], p=[0.4, 0.5, 0.1])
    demanded = random.integers(-100, 101, (many, 6)) * 1.0
    demanded[unsolved] = math.nan
    breakdown = random.normal(size=(many, len(SOURCES), 6))
    base_wrenches = random.integers(-100, 101, (many, 6)) * 1.0
    base_unknown = random.random(many) < random.choice([0.0, 0.2, 1.0], p=[0.5, 0.4, 0.1])
    condition = np.where(unsolved, UNSOLVABLE_CONDITION, random.integers(1, 9, many))
    demanded[base_unknown] = base_wrenches[base_unknown] = math.nan
    breakdown[np.isnan(demanded[:, 0])] = math.nan
    return Samples(
        many, seconds=np.cumsum(steps) - steps[0], restarts=restarts, demanded=demanded,
        forces=np.clip(demanded, -50.0, 50.0), breakdown=breakdown,
        suppressed=random.random(many) < 0.2, lengths=random.uniform(0.4, 1.6, (many, 6)),
        rates=random.integers(-10, 11, (many, 6)) * 0.1,
        unit_load=random.integers(1, 9, (many, 6)), det=random.integers(-2, 3, many),
        condition=condition, base_wrenches=base_wrenches, base_unknown=base_unknown,
        warnings=random.random(many) < 0.4,
        time_to_crossing=random.choice([0.1, 0.2, 3.0, math.inf], many),
        joint_angles=random.integers(0, 12, (many, 12)) * 0.1,
        clearances=random.integers(-2, 9, (many, 6)) * 0.01)


# The same again, sample by sample

def first_peak(numbers: Sequence[float], times: Sequence[float]) -> tuple[Any, Any]:
    """Return the number that is largest in size, with its sign, and when it is first met."""
    known = [n for n, number in enumerate(numbers) if not math.isnan(number)]
    if not known:
        return None, None
    best = max(known, key=lambda n: (abs(numbers[n]), -n))
    return numbers[best], times[best]


def over_time(numbers: Sequence[float], times: Sequence[float], gap: float,
              ) -> tuple[float, float | None]:
    """Return the integral by trapezoids and the mean."""
    area, time = [], []
    for n in range(1, len(numbers)):
        step = times[n] - times[n - 1]
        if step <= gap and not math.isnan(numbers[n] + numbers[n - 1]):
            area.append(0.5 * (numbers[n] + numbers[n - 1]) * step)
            time.append(step)
    known = [number for number in numbers if not math.isnan(number)]
    if math.fsum(time):
        return math.fsum(area), math.fsum(area) / math.fsum(time)
    return 0.0, statistics.fmean(known) if known else None


def root(number: float | None) -> float | None:
    """Return the square root, if there is a number."""
    return None if number is None else math.sqrt(number)


def plain(p: Parameters, s: Samples) -> dict[str, Any]:
    """Return what the summary must have, from its definitions."""
    t = s.seconds.tolist()
    forward = [b - a for a, b in zip(t[:999], t[1:1000], strict=False) if b > a]
    gap = max(p['setpoint.timeout'], 10.0 * statistics.median(forward) if forward else 0.0)
    steps = [b - a for a, b in zip(t, t[1:], strict=False)]
    legs, limits, breakdown = {}, [], {}
    for leg, name in enumerate(p['joints']):
        length, rate = s.lengths[:, leg].tolist(), s.rates[:, leg].tolist()
        force = s.demanded[:, leg].tolist()
        power = [f * v for f, v in zip(force, rate, strict=True)]
        low, high, fastest, strongest = (p[f'limits.{limit}'][leg] for limit in (
            'length_min', 'length_max', 'velocity_max', 'force_max'))
        peak = first_peak(force, t)
        driving, _ = over_time([x if math.isnan(x) else max(x, 0.0) for x in power], t, gap)
        braking, _ = over_time([x if math.isnan(x) else max(-x, 0.0) for x in power], t, gap)
        none = peak[0] is None
        legs[name] = {
            'length_min_m': min(length), 'length_max_m': max(length),
            'rate_peak_m_s': first_peak(rate, t)[0], 'rate_peak_at_s': first_peak(rate, t)[1],
            'force_peak_n': peak[0], 'force_peak_at_s': peak[1],
            'force_rms_n': root(over_time([f * f for f in force], t, gap)[1]),
            'force_published_peak_n': first_peak(s.forces[:, leg].tolist(), t)[0],
            'power_peak_w': first_peak(power, t)[0], 'power_peak_at_s': first_peak(power, t)[1],
            'power_mean_w': over_time(power, t, gap)[1],
            'energy_driving_j': None if none else driving,
            'energy_braking_j': None if none else braking,
            'length_margin_m': min(min(length) - low, high - max(length)),
            'rate_margin_m_s': fastest - max(map(abs, rate)),
            'force_margin_n': None if none else strongest - abs(peak[0])}
        carried, carried_at = first_peak(s.joint_forces[:, leg].tolist(), t)
        legs[name] |= {
            'joint_force_peak_n': carried, 'joint_force_peak_at_s': carried_at,
            'joint_force_margin_n': None if carried is None else p[
                'limits.joint_force_max'][leg] - abs(carried)}
        for joint, first in (('base', 0), ('platform', 6)):
            widest, at = first_peak(s.joint_angles[:, first + leg].tolist(), t)
            legs[name] |= {
                f'{joint}_joint_angle_max_rad': widest, f'{joint}_joint_angle_max_at_s': at,
                f'{joint}_joint_angle_margin_rad':
                    p[f'limits.{joint}_joint_angle_max'][leg] - widest}
        nearest = min(s.clearances[:, leg].tolist())
        legs[name] |= {
            'clearance_min_m': nearest,
            'clearance_min_at_s': t[s.clearances[:, leg].tolist().index(nearest)],
            'clearance_margin_m': nearest - p['limits.leg_clearance_min']}
        breakdown[name] = {}
        for n, source in enumerate(SOURCES[:7 if p['base.source'] != 'fixed' else 6]):
            forces = s.breakdown[:, n, leg].tolist()
            breakdown[name][source] = {
                'peak_n': first_peak(forces, t)[0],
                'rms_n': root(over_time([f * f for f in forces], t, gap)[1])}
    for limit, broken, numbers in (
            ('limits.length_min', lambda x, bound: x < bound * (1.0 - 1e-9), s.lengths),
            ('limits.length_max', lambda x, bound: x > bound * (1.0 + 1e-9), s.lengths),
            ('limits.velocity_max', lambda x, bound: abs(x) > bound * (1.0 + 1e-9), s.rates),
            ('limits.force_max', lambda x, bound: abs(x) > bound * (1.0 + 1e-9), s.demanded),
            ('limits.joint_force_max', lambda x, bound: abs(x) > bound * (1.0 + 1e-9),
             s.joint_forces),
            ('limits.base_joint_angle_max', lambda x, bound: x > bound * (1.0 + 1e-9),
             s.joint_angles[:, :6]),
            ('limits.platform_joint_angle_max', lambda x, bound: x > bound * (1.0 + 1e-9),
             s.joint_angles[:, 6:]),
            ('limits.leg_clearance_min', lambda x, bound: x < bound * (1.0 - 1e-9),
             s.clearances)):
        for leg, name in enumerate(p['joints']):
            bound = np.broadcast_to(p[limit], 6)[leg]
            found = [n for n, x in enumerate(numbers[:, leg]) if broken(x, bound)]
            if found:
                far = max(found, key=lambda n: (
                    abs(numbers[n, leg] - bound if 'min' in limit
                        else abs(numbers[n, leg]) - bound), -n))
                limits.append({
                    'limit': limit, 'leg': name, 'setpoints': len(found),
                    'worst': numbers[far, leg], 'bound': bound, 'first_at_s': t[found[0]]})
    not_checked = (['limits.force_max', 'limits.joint_force_max']
                   if np.isnan(s.demanded).any() else [])
    crossings = []
    last = None
    for n, det in enumerate(s.det.tolist()):
        if s.restarts[n]:
            last = None
        if det:
            if last is not None and det * s.det[last] < 0.0:
                share = s.det[last] / (s.det[last] - s.det[last + 1])
                crossings.append(t[last] + share * (t[last + 1] - t[last]))
            last = n
    spans: list[list[float | None]] = []
    for n, on in enumerate(s.warnings):
        if on and not (n and s.warnings[n - 1]):
            spans.append([t[n], None])
        if not on and n and s.warnings[n - 1]:
            spans[-1][1] = t[n]
    nearest = min(range(len(t)), key=lambda n: (abs(s.det[n]), n))
    soonest = min(range(len(t)), key=lambda n: (s.time_to_crossing[n], n))
    worst = max(range(len(t)), key=lambda n: (s.condition[n], -n))
    ever = s.time_to_crossing[soonest] < math.inf
    without = np.isnan(s.demanded[:, 0])
    unsolved = without & (~s.base_unknown | (s.condition >= UNSOLVABLE_CONDITION))
    unknown = np.flatnonzero(s.base_unknown)
    base_wrench = {}
    for name, part in (('force', s.base_wrenches[:, :3]), ('moment', s.base_wrenches[:, 3:])):
        base_wrench[name] = of_base(np.linalg.norm(part, axis=1).tolist(), t, gap, name)
    for n, name in enumerate(AXES):
        base_wrench[name] = of_base(s.base_wrenches[:, n].tolist(), t, gap, name)
    most_loaded = int(np.argmax(s.unit_load.max(axis=0)))
    return {
        'quasi_static': False,
        'setpoints': {
            'answered': len(t), 'first_stamp_ns': int(s.stamps[0]),
            'last_stamp_ns': int(s.stamps[-1]), 'duration_s': t[-1],
            'gaps': sum(step > gap for step in steps),
            'gaps_s': math.fsum(step for step in steps if step > gap),
            'restarts': sum(s.restarts.tolist()), 'base_unknown': len(unknown),
            'base_unknown_first_at_s': t[unknown[0]] if len(unknown) else None,
            'jumps': 0, 'jumps_first_at_s': None},
        'legs': legs, 'motors': None, 'limits': limits, 'limits_not_checked': not_checked,
        'singularity': {
            'determinant_nearest_m3': s.det[nearest], 'determinant_nearest_at_s': t[nearest],
            'crossings': len(crossings), 'crossings_at_s': crossings[:LISTED],
            'condition_max': s.condition[worst], 'condition_max_at_s': t[worst],
            'unsolved': int(unsolved.sum()),
            'suppressed': int((np.isnan(s.forces[:, 0]) & ~without).sum()),
            'time_to_crossing_min_s': s.time_to_crossing[soonest] if ever else None,
            'time_to_crossing_min_at_s': t[soonest] if ever else None,
            'unit_load_force_max': s.unit_load.max(),
            'unit_load_force_leg': p['joints'][most_loaded],
            'warnings': len(spans), 'warnings_from_to_s': spans[:LISTED],
            'warning_s': math.fsum(step for n, step in enumerate(steps)
                                   if s.warnings[n] and step <= gap)},
        'force_breakdown': breakdown, 'base_wrench': base_wrench,
        'limit_met': bool(limits or not_checked or spans)}


def of_base(numbers: list[float], times: list[float], gap: float, name: str) -> dict[str, Any]:
    """Return what the summary has of a component of the base wrench."""
    unit = 'n_m' if name.startswith('moment') else 'n'
    peak, at = first_peak(numbers, times)
    return {f'rms_{unit}': root(over_time([x * x for x in numbers], times, gap)[1]),
            f'mean_{unit}': over_time(numbers, times, gap)[1], f'peak_{unit}': peak,
            'peak_at_s': at}


def assert_same(found: Any, truth: Any, at: str = '') -> None:
    """Assert that both hold the same, numbers but for rounding."""
    if isinstance(truth, dict):
        assert list(found) == list(truth), at
        for key in truth:
            assert_same(found[key], truth[key], f'{at}/{key}')
    elif isinstance(truth, list):
        assert len(found) == len(truth), at
        for n, (each, other) in enumerate(zip(found, truth, strict=True)):
            assert_same(each, other, f'{at}/{n}')
    elif isinstance(truth, float):
        assert isinstance(found, float), at
        assert found == pytest.approx(truth, rel=1e-12, abs=1e-12), at
    else:
        assert type(found) is type(truth), at
        assert found == truth, at


@given(st.integers(0, 10 ** 6), st.integers(1, 50))
def test_the_summary_agrees_with_its_definitions(seed: int, many: int) -> None:
    samples, parameters = random_samples(seed, many), hexapod(**LIMITS)
    found = motion_of(samples.summary(parameters))
    assert_same(json.loads(to_json(found)), json.loads(to_json(plain(parameters, samples))))


@given(st.data(), st.integers(0, 10 ** 6), st.integers(1, 60))
def test_any_split_gives_the_same_and_can_be_read_before_the_end(
        data: st.DataObject, seed: int, many: int) -> None:
    edges = sorted(data.draw(st.lists(st.integers(0, many), max_size=many)))
    samples, parameters = random_samples(seed, many), hexapod(**LIMITS)
    whole, split = samples.summary(parameters), samples.summary(parameters, edges)
    for _ in range(2):
        assert_same(motion_of(split), motion_of(whole))
    early = Summary(parameters)
    for part, end in zip(samples.parts(parameters, edges), [*edges, many], strict=True):
        early.add_block(part)
        assert early.values().setpoints.answered == end


def test_a_long_motion_is_the_same_in_blocks_of_any_size() -> None:
    samples, parameters = random_samples(1, 3000), hexapod(**LIMITS)
    # the usual step is that of the first thousand setpoints
    samples.seconds[1500:] += np.arange(1500) * 0.4
    expected = plain(parameters, samples)
    assert expected['setpoints']['gaps'] > 500
    crossings = expected['singularity']['crossings_at_s']
    assert expected['singularity']['crossings'] > len(crossings) == LISTED
    assert expected['singularity']['warnings'] > LISTED
    for size in (1, 7, 999, 1000, 1001, 2500):
        found = motion_of(samples.summary(parameters, range(size, 3000, size)))
        assert_same(json.loads(to_json(found)), json.loads(to_json(expected)))


def test_it_keeps_no_samples() -> None:
    samples, parameters = random_samples(1, 2000), hexapod(**LIMITS)
    outputs, setpoints = samples.outputs(parameters), samples.setpoints()
    summary = Summary(parameters)

    def held_after(blocks: int) -> int:
        for n in range(blocks):
            # new arrays: any that the summary keeps would be counted
            summary.add_block(Answered(
                samples.seconds + n, setpoints.chosen(np.arange(2000)),
                part_of(outputs, slice(None)), samples.base_wrenches.copy(),
                samples.demanded * samples.rates, samples.breakdown.copy()))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        held = held_after(10)
        assert held_after(40) - held < 50_000
    finally:
        tracemalloc.stop()


def test_every_key_is_documented() -> None:
    def keys(tree: Any, at: str = '') -> set[str]:
        if isinstance(tree, dict):
            return {key for name, each in tree.items() for key in keys(each, f'{at}.{name}')}
        if isinstance(tree, list) and tree and isinstance(tree[0], dict):
            return keys(tree[0], f'{at}[]')
        return {at.lstrip('.')}

    samples = random_samples(1, 50)
    parameters = hexapod(**LIMITS, **{'base.source': 'imu'})
    found = keys(motion_of(samples.summary(parameters)))
    for leg in parameters['joints']:
        found = {key.replace(f'legs.{leg}.', 'legs.NAME.').replace(
            f'force_breakdown.{leg}.', 'force_breakdown.NAME.') for key in found}
    for source in SOURCES:
        found = {key.replace(f'.{source}.', '.SOURCE.') for key in found}
    # one row of the page has the keys of several
    loads = {key for key in found if key.startswith('base_wrench.')}
    assert loads == {f'base_wrench.{kind}{axis}.{key}' for kind, unit in (
        ('force', 'n'), ('moment', 'n_m')) for axis in ('', '_x', '_y', '_z') for key in (
        f'rms_{unit}', f'mean_{unit}', f'peak_{unit}', 'peak_at_s')}
    found = {re.sub(r'\.(force|moment)(_.)?\.', lambda name: f'.{name[1].upper()}.', key)
             if key in loads else key for key in found}
    text = (ROOT / 'docs' / 'summary.md').read_text(encoding='utf-8')
    documented = set(re.findall(r'^\| `([^`]+)` \|', text, flags=re.MULTILINE))
    assert found <= documented
    parts = ('setpoints.', 'legs.', 'limits[]', 'singularity.', 'force_breakdown.',
             'base_wrench.')
    assert {key for key in documented if key.startswith(parts)} == found - {
        'limit_met', 'limits_not_checked', 'motors', 'quasi_static'}
    assert set(SOURCES) <= documented


# Energy

def test_energy_of_a_leg_that_drives_and_brakes() -> None:
    time = np.linspace(0.0, 2.0 * math.pi, 10001)
    samples = Samples(10001, seconds=time, demanded=100.0 * np.sin(time)[:, None],
                      rates=0.5 * np.cos(time)[:, None])
    leg = motion_of(samples.summary(hexapod()))['legs']['b']
    # P = 25 sin 2t: two humps of 25 each way
    assert leg['energy_driving_j'] == pytest.approx(50.0, rel=1e-6)
    assert leg['energy_braking_j'] == pytest.approx(50.0, rel=1e-6)
    assert leg['power_mean_w'] == pytest.approx(0.0, abs=1e-9)
    assert leg['force_rms_n'] == pytest.approx(100.0 / math.sqrt(2.0), rel=1e-9)
    assert abs(leg['power_peak_w']) == pytest.approx(25.0, rel=1e-6)


def test_slow_setpoints_are_no_gaps() -> None:
    assert values(5, seconds=[0.0, 2.0, 4.0, 6.0, 25.0])['setpoints']['gaps'] == 0
    assert values(5, seconds=[0.0, 2.0, 4.0, 6.0, 27.0])['setpoints']['gaps'] == 1


def test_without_a_setpoint_there_is_nothing() -> None:
    summary = Summary(hexapod(**LIMITS))
    to_json(summary.values())
    found = motion_of(summary)
    assert found['setpoints'] == {
        'answered': 0, 'first_stamp_ns': None, 'last_stamp_ns': None, 'duration_s': 0.0,
        'gaps': 0, 'gaps_s': 0.0, 'restarts': 0, 'base_unknown': 0,
        'base_unknown_first_at_s': None, 'jumps': 0, 'jumps_first_at_s': None}
    assert set(found['base_wrench']['moment'].values()) == {None}
    assert set(found['legs']['front left'].values()) == {None}
    assert (found['limits'], found['force_breakdown'], found['limit_met']) == ([], None, False)
    assert summary_lines(summary.values()) == ['no setpoint could be answered']
    assert_same(motion_of(Samples(0).summary(hexapod())), motion_of(Summary(hexapod())))


def test_there_are_no_margins_without_limits() -> None:
    leg = values(2)['legs']['b']
    assert leg['length_margin_m'] is leg['rate_margin_m_s'] is leg['force_margin_n'] is None
    only = Samples(2, lengths=[[1.0] * 6, [1.25] * 6]).summary(
        hexapod(**{'limits.length_max': 1.5})).values().legs['b']
    assert only.position_margin == 0.25


def test_numbers_that_are_not_finite_are_null() -> None:
    found = values(2, demanded=1e200, rates=1e200)['legs']['b']
    assert found['force_peak_n'] == 1e200
    assert found['force_rms_n'] is found['power_mean_w'] is found['energy_driving_j'] is None


# Crossings

@pytest.mark.parametrize(('determinants', 'crossings'), [
    ([3.0, 1.0], []), ([3.0, -1.0], [0.75]), ([-1.0, 3.0], [0.25]),
    ([1.0, -1.0, 1.0], [0.5, 1.5]), ([1.0, 0.0, -1.0], [1.0]), ([1.0, 0.0, 1.0], []),
    ([0.0, 0.0, 1.0], []), ([-1.0, 0.0], []), ([2.0, 0.0, 0.0, -1.0, 1.0], [1.0, 3.5]),
    ([0.0, -1.0, 0.0, 2.0], [2.0]), ([1e-300, -1e-300], [0.5]), ([0.0], [])])
def test_crossings_are_interpolated(determinants: list[float], crossings: list[float]) -> None:
    found = singularity(len(determinants), det=determinants)
    assert found['crossings_at_s'] == pytest.approx(crossings)
    assert found['crossings'] == len(crossings)


# The table

def test_a_small_example() -> None:
    nan = math.nan
    samples = Samples(
        4, seconds=[0.0, 1.0, 2.0, 4.0],
        lengths=[[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.5, 1.0, 3.0, 4.0, 5.0, 6.0],
                 [0.5, 3.0, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]],
        demanded=[[10.0, -20.0, 5.0, 0.0, 1.0, 2.0], [-30.0, 15.0, 5.0, 0.0, 1.0, 2.0],
                  [20.0, 25.0, 5.0, 0.0, 1.0, 3.0], [nan] * 6],
        rates=0.25, det=[3.0, 1.0, -1.0, -2.0], condition=[1.0, 2.0, 3.0, 2.0],
        warnings=[False, True, True, False],
        base_wrenches=[[0.0, 0.0, -10.0, 1.0, 1.0, 1.0], [30.0, 0.0, -40.0, 1.0, 1.0, 1.0],
                       [0.0, 0.0, -40.0, 1.0, 1.0, 1.0], [0.0, 0.0, -20.0, 1.0, 1.0, 1.0]])
    assert table_of(samples, hexapod(**{
        'limits.length_min': 0.75, 'limits.length_max': 10.0, 'limits.force_max': 25.0,
    })).splitlines() == [
        '4 setpoints in 4.00 s',
        '',
        '            --------------force [N]-------------- power [W] ------length [m]------- '
        'rate [m/s]',
        'leg              peak    at [s]      RMS   margin      peak    from      to  margin'
        '     peak',
        'front left      -30.0*     1.00     24.0     -5.0      -7.5  0.5000  1.5000 -0.2500'
        '   0.2500',
        'b                25.0*     2.00     19.2      0.0       6.2  1.0000  3.0000  0.2500'
        '   0.2500',
        'c                 5.0      0.00      5.0     20.0       1.2  3.0000  3.0000  2.2500'
        '   0.2500',
        'd                 0.0      0.00      0.0     25.0       0.0  4.0000  4.0000  3.2500'
        '   0.2500',
        'e                 1.0      0.00      1.0     24.0       0.2  5.0000  5.0000  4.2500'
        '   0.2500',
        'f                 3.0      2.00      2.3     22.0       0.8  6.0000  6.0000  4.0000'
        '   0.2500',
        '* reaches limits.force_max: the published force is clipped to it',
        'limits.length_min, 0.75 m, exceeded by front left: 0.5 m at worst, first at t = 2.00 s',
        'limits.force_max, 25 N, exceeded by front left: -30 N at worst, first at t = 1.00 s',
        'limits.force_max could not be checked in 1 setpoint: J_inv cannot be solved',
        'force on the base: 50.0 N at most at t = 1.00 s (RMS 36.6)',
        'moment on the base: 1.7 N m at most at t = 0.00 s (RMS 1.7)',
        '',
        'det(J) crossed zero at t = 1.50 s: forces grow without bound there',
        'J_inv cannot be solved in 1 setpoint: they have no forces',
        'singularity warning at t = 1.00 s, 0.50 s before the crossing, for 3.00 s in all',
        'det(J) nearest zero: 1 m^3 at t = 1.00 s',
        'condition number of J_inv: 3 at most, at t = 2.00 s']


@given(st.integers(0, 10 ** 6), st.integers(0, 60), st.floats(1e-3, 1e9), st.booleans())
def test_the_table_is_no_wider_than_100_columns(
        seed: int, many: int, scale: float, limited: bool) -> None:
    samples = random_samples(seed, many) if many else Samples(0)
    samples.demanded *= scale
    samples.forces *= scale
    table = table_of(samples, hexapod(**LIMITS) if limited else hexapod())
    assert all(len(line) <= 100 and line == line.rstrip() for line in table.splitlines())
    assert 'nan' not in table
    assert 'inf' not in table
    assert 'None' not in table


FORCE_LIMIT = {'limits.force_max': 5.0}


@pytest.mark.parametrize(('given_', 'limits', 'shown', 'absent'), [
    ({'many': 1}, FORCE_LIMIT, 'within all limits', 'singularity warning at'),
    ({'many': 1}, FORCE_LIMIT, '1 setpoint in 0.00 s', ''),
    ({'many': 1}, {}, 'det(J) did not cross zero\nno singularity warning', 'limits'),
    ({'many': 1, 'demanded': 5.0}, FORCE_LIMIT, '5.0*', 'exceeded'),
    ({'many': 3, 'demanded': math.nan}, FORCE_LIMIT,
     'J_inv cannot be solved in 3 setpoints: they have no forces', 'force [N]'),
    ({'many': 3, 'suppressed': 1.0}, {}, 'forces were suppressed in 3 setpoints', ''),
    ({'many': 4, 'demanded': [[1.0] * 6, [math.nan] * 6, [math.nan] * 6, [1.0] * 6]}, FORCE_LIMIT,
     'limits.force_max could not be checked in 2 setpoints: J_inv cannot', 'within all limits'),
    ({'many': 5, 'det': [2.0, 1.0, -1.0, -2.0, -3.0], 'warnings': [0, 1, 0, 1, 1]}, {},
     'singularity warning at t = 1.00 s, 0.50 s before the crossing and 1 time more, for 2.00 s',
     ''),
    ({'many': 40, 'det': (-1.0) ** np.arange(40)}, {},
     'det(J) crossed zero at t = 0.50 s and 38 times more: forces grow without bound', ''),
    ({'many': 2, 'demanded': 6.0}, FORCE_LIMIT,
     'limits.force_max, 5 N, exceeded by front left and 5 other legs: 6 N at worst, first at t = '
     '0.00 s', 'within all limits'),
    ({'many': 5, 'seconds': [0.0, 0.1, 0.2, 3.2, 3.2], 'restarts': [0, 0, 0, 0, 1]}, {},
     '5 setpoints in 3.20 s, of them 3.00 s in 1 gap, 1 restart\n', '')])
def test_statements_for_the_terminal(
        given_: dict[str, Any], limits: dict[str, Any], shown: str, absent: str) -> None:
    table = table_of(Samples(**given_), hexapod(**limits))
    assert shown in table
    assert not absent or absent not in table


def test_cards_of_the_report_have_the_worst_level_of_their_statements() -> None:
    samples = Samples(2, det=[1.0, -1.0], warnings=1.0, demanded=6.0)
    found = {**motion_of(samples.summary(hexapod(**FORCE_LIMIT))),
             'rejected': [{'topic': f'{n}', 'count': n, 'reason': 'late'} for n in range(1, 6)]}

    def shown(**changes: Any) -> dict[str, tuple[str, str]]:
        return {name: card[:2] for name, card in cards(bag_summary(found, **changes)).items()}

    assert shown() == {
        'reading': ('warn', 'Not all messages could be used'),
        'inputs': ('none', 'Inputs'),
        'limits': ('bad', 'Limits are exceeded'),
        'singularity': ('bad', 'A singularity is reached'),
        'motors': ('none', 'Motors'),
        'measured': ('none', 'Measured forces')}
    assert shown(missing=['a chunk'])['reading'][0] == 'bad'
    assert shown(rejected=[])['reading'] == ('good', 'The whole bag was read')
    assert shown(limits=[])['limits'] == ('good', 'All limits are held')
    assert shown(limits=[], limits_not_checked=['limits.velocity_max'])['limits'][0] == 'warn'
    empty = Summary(hexapod()).values()
    assert [card.level for card in cards(empty).values()] == ['good', *['none'] * 5]
    lines = [each.line for each in cards(bag_summary(found))['reading'].statements]
    assert lines == ['2 setpoints in 1.00 s', '5: 5 rejected: late', '4: 4 rejected: late',
                     '3: 3 rejected: late', '3 not used for other reasons']
    jumps = bag_summary(found, setpoints={
        **found['setpoints'], 'jumps': 2, 'jumps_first_at_s': 0.5})
    assert ('2 jumps, first at t = 0.50 s: the legs cannot follow within limits.velocity_max'
            in [each.line for each in cards(jumps)['limits'].statements])


@pytest.mark.parametrize(('mistake', 'level', 'line'), [
    (None, 'good', 'within all limits by the demands of the setpoints'),
    ({'what': 'sign', 'text': 'the efforts have the opposite sign'}, 'warn',
     'within all limits by the demands of the setpoints, which the measured efforts contradict '
     '(possible error: sign)')])
def test_limits_are_held_by_demands_which_measured_efforts_may_contradict(
        mistake: dict[str, str] | None, level: str, line: str) -> None:
    measured = {'setpoints_compared': 2, 'contacts': {'count': 0}, 'residual_share': None,
                'headline': '', 'likely_mistake': mistake}
    found = bag_summary(motion_of(Samples(2).summary(hexapod(**FORCE_LIMIT))), measured=measured)
    card = cards(found)['limits']
    assert (card.level, [each.line for each in card.statements]) == (level, [line])
    assert cards(found)['measured'].level == level
    assert line in ' '.join(' '.join(summary_lines(found)).split())


def test_dropped_messages_are_not_called_rejected() -> None:
    found = bag_summary(motion_of(Samples(2).summary(hexapod())), rejected=[
        {'topic': 'setpoint', 'count': 49, 'reason': NOT_JOINED}])
    assert ('setpoint: 49 dropped: not all topics had its stamp'
            in [each.line for each in cards(found)['reading'].statements])


def test_large_numbers_of_the_table_have_a_space_before_them() -> None:
    samples = Samples(2, demanded=-1e10, rates=-1e100, lengths=1e10)
    row = table_of(samples, hexapod(**LIMITS)).splitlines()[4].split()
    assert len(row) == 12 and '-1e+100' in row  # the name has two words


def test_velocities_rates_power_and_energy_of_poses_are_not_known() -> None:
    samples = Samples(3, rates=0.0, breakdown=1.0)
    summary = samples.summary(hexapod(**LIMITS), quasi_static=True)
    found = motion_of(summary)
    leg = found['legs']['b']
    assert {key for key, value in leg.items() if value is None} == {
        'rate_peak_m_s', 'rate_peak_at_s', 'rate_margin_m_s', 'power_peak_w', 'power_peak_at_s',
        'power_mean_w', 'energy_driving_j', 'energy_braking_j'}
    assert {source for source, value in found['force_breakdown']['b'].items()
            if value['peak_n'] is not None} == {'gravity', 'wrench'}
    assert found['singularity']['time_to_crossing_min_s'] is None
    # a limit that cannot be checked is not held
    assert (found['limits'], found['limits_not_checked']) == ([], ['limits.velocity_max'])
    assert found['limit_met']
    text = '\n'.join(summary_lines(summary.values()))
    assert 'limits.velocity_max could not be checked' in text
    assert 'within all limits' not in text
    assert not samples.summary(hexapod(**FORCE_LIMIT), quasi_static=True).values().limit_met


def test_setpoints_without_a_known_base_are_counted_and_have_no_forces() -> None:
    demanded, loads = np.ones((4, 6)), np.ones((4, 6))
    demanded[1:3] = loads[1:3] = math.nan
    samples = Samples(4, demanded=demanded, base_wrenches=loads, base_unknown=[0, 1, 1, 0])
    limited = hexapod(**FORCE_LIMIT)
    for parameters, checked in ((limited, False), (hexapod(), True)):
        found = samples.summary(parameters).values()
        assert found.setpoints.base_unknown == 2
        assert found.setpoints.base_unknown_first_at_s == 1.0
        assert (found.singularity.unsolved, found.singularity.suppressed) == (0, 0)
        assert bool(found.limits_not_checked) is found.limit_met is not checked
        text = '\n'.join(summary_lines(found))
        assert ("the base's motion is not known in 2 setpoints, first at t = 1.00 s: they have no "
                'forces') in text
        assert ("limits.force_max could not be checked in 2 setpoints: the base's motion is not "
                'known' in text) is not checked
    both = Samples(4, demanded=demanded, base_wrenches=loads, base_unknown=[0, 1, 0, 0])
    assert ("in 1 setpoint: J_inv cannot be solved; in 1 setpoint: the base's motion is not known"
            in ' '.join(table_of(both, limited).split()))


def test_a_limit_is_exceeded_only_above_its_tolerance() -> None:
    bound = 5.0
    for factor, exceeded in ((1.0 + 5e-10, False), (1.0 + 5e-9, True)):
        found = Samples(1, demanded=bound * factor).summary(
            hexapod(**{'limits.force_max': bound})).values()
        assert bool(found.limits) is exceeded

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The program stewart_capability: its figures applied in the dynamics, its page, its errors."""

from __future__ import annotations

from collections.abc import Callable
import csv
from html.parser import HTMLParser
import json
import math
from pathlib import Path
import re
import shutil
from typing import Any
from urllib.parse import unquote

import messages
import numpy as np
from programs import call
import pytest
from referees import random_direction, rng, rotation_about

from snapshot import Snapshot
from stewart_dynamics import (
    BaseMotion, Capability, Motion, Parameters, Pose, PoseError, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.datasheet import main
from stewart_dynamics.datasheet.claimed_box import doubtful_ranges
from stewart_dynamics.datasheet.datasheet import soft_legs
from stewart_dynamics.datasheet.datasheet_record import (
    Box, HeldPayload, JudgedMotion, Rating, Translations)
from stewart_dynamics.datasheet.datasheet_text import (
    between_setpoints, both_ways, box_verdict, down, LINEAR, motion_verdict, numbers,
    rated_payload, setpoints_used)
from stewart_dynamics.datasheet.hexapod_drawing import Drawing, upright
from stewart_dynamics.datasheet.motion_ratings import judged, uses
from stewart_dynamics.datasheet.pose_ratings import AXES, KEYS, Payloads, rate_poses, stiffness
from stewart_dynamics.datasheet.rated_hexapod import Payload, RatedHexapod
from stewart_dynamics.mechanics.parameter_errors import find_option_errors
from stewart_dynamics.replay import main as replay
from stewart_dynamics.replay.recorded_motion import read_motion, RecordedMotion
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.block_statistics import finite
from stewart_dynamics.reporting.vector_picture import hull, ticks

PROGRAM = 'stewart_capability'

ROOT = Path(__file__).resolve().parent.parent
PLATFORM = ROOT / 'config' / 'platform.yaml'
PARAMETERS = Parameters.from_yaml(PLATFORM)
PIVOT = np.array([0.05, -0.1, 0.3])
BROWSER = shutil.which('chromium') or shutil.which('chromium-browser')


@pytest.fixture(scope='module')
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a datasheet with everything in it."""
    folder = tmp_path_factory.mktemp('capability')
    box = folder / 'box.yaml'
    box.write_text('x: 0.1\ny: [-0.1, 0.1]\nrx: 0.2\n')
    call(main, '--params', PLATFORM, '--pivot', *PIVOT, '--payload', 40, 0, 0, 0.2, '--box', box,
         '--motion', ROOT / 'bags' / 'clear', '--leg-stiffness', 5e7, '--output', folder / 'sheet',
         '--strict')
    return folder / 'sheet'


@pytest.fixture(scope='module')
def figures(sheet: Path) -> dict[str, Any]:
    """Return the content of datasheet.json."""
    document: dict[str, Any] = json.loads((sheet / 'datasheet.json').read_text())
    return document


def test_the_files_are_there_and_name_what_limits(sheet: Path, figures: dict[str, Any]) -> None:
    assert sorted(each.name for each in sheet.iterdir()) == [
        'datasheet.html', 'datasheet.json', 'workspace.csv']
    assert [*figures['travel']] == [*figures['velocity']] == [*figures['acceleration']] == [*KEYS]
    for name in ('travel', 'velocity', 'acceleration'):
        for each in figures[name].values():
            if each['limit'] == 'singularity':
                assert each['leg'] is None
            else:
                assert each['leg'] in PARAMETERS['joints']
                assert f'limits.{each["limit"]}' in PARAMETERS
    assert figures['box']['possible']
    assert figures['motion']['possible']
    assert figures['motion']['factor'] > 1.0
    assert figures['payload']['any_orientation'] < figures['payload']['value']
    assert figures['stiffness']['worst']['frequencies'][0] < figures['stiffness']['frequencies'][0]
    platform = StewartPlatform(PARAMETERS)
    loaded = RatedHexapod(PARAMETERS, payload=Payload(40.0, np.array([0.0, 0.0, 0.2]))).platform
    held = StewartPlatform(loaded.parameters.replaced({'actuator.reflected_mass': 0.0}))
    for (i, j), plane in zip(((0, 2), (1, 2), (0, 1)), ('xz', 'yz', 'xy'), strict=True):
        found = figures['stiffness']['sections'][plane]
        values = np.array(found['frequencies'], dtype=float)
        assert 0.2 < np.isfinite(values).mean() < 0.95
        for n, m in np.argwhere(np.isfinite(values))[::97]:
            position = platform.home_pose().position.copy()
            position[[i, j]] += found['first'][n], found['second'][m]
            at = Pose(position, platform.home_pose().rotation)
            assert Capability(platform).travel(at, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]).value > 0.0
            assert values[n, m] == pytest.approx(
                Capability(held).modes(at, 5e7).frequencies[0], rel=1e-6)
    page = (sheet / 'datasheet.html').read_text()
    assert page.count('aria-label="Lowest natural frequency') == page.count('"outside"') == 3
    assert page.count(f'smallest at {figures["worst"]["poses"]} poses') == 1


def test_numbers_of_a_vector_have_the_digits_of_the_largest() -> None:
    assert numbers([3.3333e-5, -1e-9, 0.32060004], 1e3, ' mm') == '0.03, 0, 320.6 mm'
    assert numbers([1e-17, -1e-17, 0.0]) == '0, 0, 0'
    assert numbers([-0.25] * 6) == '−0.25'


def test_travel_is_about_the_pivot_and_the_table_ends_at_the_limits(
        sheet: Path, figures: dict[str, Any]) -> None:
    platform = StewartPlatform(PARAMETERS)
    c, home = Capability(platform), platform.home_pose()
    for key, direction in zip(KEYS, np.repeat(np.eye(6), 2, axis=0) * np.tile(
            [1.0, -1.0], 6)[:, None], strict=True):
        found = c.travel(home, direction, PIVOT)
        assert figures['travel'][key]['value'] == pytest.approx(found.value, rel=1e-12)
        assert figures['travel'][key]['limit'] == found.limit
    rows = list(csv.DictReader((sheet / 'workspace.csv').open()))
    ends = np.array([[float(each[axis]) for axis in AXES] for each in rows])
    assert len(ends) > 6 * 200
    center = home.position + PIVOT
    rates = np.linalg.norm(ends[:, 3:], axis=1)
    turns = np.array([rotation_about(each[3:] / rate, rate) if rate else np.eye(3)
                      for each, rate in zip(ends, rates, strict=True)])
    result = platform.inverse_dynamics(Motion.from_pose(
        Pose(center + ends[:, :3] - turns @ PIVOT, turns)), singular='nan')
    room = np.minimum(result.lengths - 0.95, 1.65 - result.lengths).min(axis=1)
    assert room.min() > -1e-8
    lengths = np.array([each['limit'].startswith('length_') for each in rows])
    assert np.abs(room[lengths]).max() < 1e-8
    assert result.condition_number[~lengths] == pytest.approx(100.0, rel=1e-5)


def test_ranges_at_once_are_reachable_and_no_larger_ones_are(figures: dict[str, Any]) -> None:
    c = Capability(StewartPlatform(PARAMETERS))
    for name in ('translation', 'rotation', 'all'):
        ranges = np.array([figures['at_once'][name]['ranges'][axis] for axis in AXES])
        assert c.reachable(ranges, pivot=PIVOT).certain
        assert not c.reachable(1.0001 * ranges, pivot=PIVOT).certain


def test_force_and_moment_act_at_the_pivot() -> None:
    rated = RatedHexapod(PARAMETERS, pivot=PIVOT)
    found, home = rate_poses(rated, rated.pose[None]), StewartPlatform(PARAMETERS).home_pose()
    for key in KEYS:
        kind = 'moment' if key.startswith('r') else 'force'
        load = np.zeros(6)
        load[KEYS.index(key) // 2] = getattr(found, kind).under(key).value * (
            -1.0 if key[-1] == '-' else 1.0)
        load[3:] += np.cross(PIVOT, load[:3])
        forces = StewartPlatform(PARAMETERS).inverse_dynamics(
            Motion.from_pose(home), wrench=-load).forces
        assert np.abs(forces).max() == pytest.approx(6000.0, rel=1e-9)


def test_the_rated_payload_brings_a_leg_to_its_largest_force(snapshot: Snapshot) -> None:
    rated = RatedHexapod(PARAMETERS, pivot=PIVOT)
    largest = rate_poses(rated, rated.pose[None]).payload.value
    loaded = RatedHexapod(PARAMETERS, payload=Payload(largest * (1.0 - 1e-12), PIVOT))
    forces = loaded.platform.inverse_dynamics(Motion.from_pose(loaded.pose)).forces
    assert np.abs(forces).max() == pytest.approx(6000.0, rel=1e-9)
    with snapshot.raises(PoseError):
        RatedHexapod(PARAMETERS, payload=Payload(1.001 * largest, PIVOT))


def test_natural_frequencies_are_those_with_held_motors() -> None:
    driven = PARAMETERS.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.005, 'drive.gear_ratio': 3.0,
        'drive.motor_inertia': 1.37e-4})
    found = [stiffness(RatedHexapod(each), 5e7, None, 3).frequencies
             for each in (PARAMETERS, driven)]
    assert found[0] == found[1]
    held = StewartPlatform(driven.replaced({
        'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None, 'drive.screw_inertia': None}))
    np.testing.assert_allclose(
        found[0], held.natural_modes(held.home_pose(), 5e7).frequencies, rtol=1e-3)


def test_a_payload_in_any_orientation_exceeds_no_force_under_any_gravity() -> None:
    platform, random = StewartPlatform(PARAMETERS), rng()
    home = platform.home_pose()
    for offset, height in ((0.0, 0.0), (0.3, 0.4)):
        mass = Payloads(Capability(platform), home[None]).any_orientation(offset, height)
        largest = 0.0
        for azimuth in np.linspace(0.0, 2.0 * math.pi, 36, endpoint=False)[::1 if offset else 36]:
            center = np.array([offset * math.cos(azimuth), offset * math.sin(azimuth), height])
            loaded = RatedHexapod(
                PARAMETERS.replaced({'limits.force_max': 1e9}), payload=Payload(mass, center))
            gravities = 9.80665 * np.array([random_direction(random) for _ in range(500)])
            forces = loaded.platform.inverse_dynamics(
                Motion.from_pose(home), base=BaseMotion(gravities)).forces
            largest = max(largest, float(np.abs(forces).max()))
        assert largest <= 6000.0 * (1.0 + 1e-9)
        assert largest > 0.98 * 6000.0


DRIVEN = PARAMETERS.replaced({
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.motor_inertia': 7e-5,
    'drive.efficiency': 0.85, 'drive.torque_max': 8.0, 'drive.torque_continuous': 2.4})


@pytest.mark.parametrize(('changes', 'limit'), [
    ({'drive.torque_max': 0.3, 'drive.torque_continuous': None}, 'drive.torque_max'),
    ({'drive.torque_speed': [0.0, 0.3, 600.0, 0.2]}, 'drive.torque_speed'),
    ({'limits.force_max': 100.0}, 'limits.force_max')])
def test_a_pose_that_cannot_be_held_has_no_datasheet(
        changes: dict[str, Any], limit: str, tmp_path: Path) -> None:
    DRIVEN.replaced(changes).to_yaml(tmp_path / 'weak.yaml')
    said = call(main, '--params', tmp_path / 'weak.yaml', '--output', tmp_path / 'sheet',
                code=2).err
    assert re.search(rf'pose: leg_\d: .* above {limit}$', said, re.MULTILINE), said
    assert not (tmp_path / 'sheet').exists()


def test_the_payloads_of_peak_and_continuous_torque_are_named(tmp_path: Path) -> None:
    DRIVEN.to_yaml(tmp_path / 'a.yaml')
    printed = call(main, '--params', tmp_path / 'a.yaml', '--pivot', *PIVOT, '--output',
                   tmp_path / 'sheet').out
    sheet = json.loads((tmp_path / 'sheet' / 'datasheet.json').read_text())
    assert sheet['payload']['limit'] == 'torque_max'
    assert sheet['payload']['continuous']['limit'] == 'torque_continuous'
    assert sheet['payload']['continuous']['value'] < sheet['payload']['value']
    home = StewartPlatform(DRIVEN).home_pose().position
    assert sheet['pose']['position'] == home.tolist()
    assert sheet['pose']['pivot_position'] == (home + PIVOT).tolist()
    page = (tmp_path / 'sheet' / 'datasheet.html').read_text()
    for text in ('continuous torque of a motor', 'torque of a motor'):
        assert text in printed and text in page
    assert all(each in page for each in DRIVEN.drives)
    assert page.count('>pivot</text>') == 2


def test_heights_are_those_of_the_platform_and_stay_in_the_picture() -> None:
    home = StewartPlatform(PARAMETERS).home_pose()
    svg = Drawing(PARAMETERS, home, (), np.array([0.0, 0.0, 30.0])).front().svg()
    assert f'>{1e3 * home.position[2]:.0f}</text>' in svg
    for name, most in (('x', 340.0), ('y', 360.0)):
        assert all(0.0 <= float(each) <= most
                   for each in re.findall(rf' c?{name}[12]?="([-0-9.e]+)"', svg))


@pytest.fixture(scope='module')
def recorded() -> RecordedMotion:
    """Return a motion of one second along z."""
    t = np.linspace(0.0, 1.0, 101)
    still = np.zeros((101, 3))
    z = np.array([0.0, 0.0, 1.0])
    motion = Motion(
        [0.0, 0.0, 1.18] + 0.1 * np.sin(3.0 * t)[:, None] * z, np.eye(3),
        0.3 * np.cos(3.0 * t)[:, None] * z, still, -0.9 * np.sin(3.0 * t)[:, None] * z, still)
    return RecordedMotion(t, motion, np.zeros((101, 6)), None, [])


def test_a_motion_at_its_factor_uses_a_limit_whole(recorded: RecordedMotion) -> None:
    platform = StewartPlatform(PARAMETERS)
    used = uses(platform, recorded)
    found = judged(platform, recorded, used)
    k, m = found.factor, recorded.motion
    faster = recorded._replace(motion=Motion(
        m.position, m.rotation, k * m.linear_velocity, m.angular_velocity,
        k * k * m.linear_acceleration, m.angular_acceleration))
    used = uses(platform, faster)
    assert found.limit == 'velocity_max'
    assert max(each.max() for each in used.values()) == pytest.approx(1.0, rel=1e-9)
    assert recorded.seconds[int(used['rate'].argmax())] == found.at_s


def test_the_motion_between_setpoints_is_judged_where_it_is_known(
        recorded: RecordedMotion, snapshot: Snapshot) -> None:
    platform, few = StewartPlatform(PARAMETERS), slice(2, None, 49)
    coarse = recorded._replace(
        seconds=recorded.seconds[few] - recorded.seconds[2],
        motion=Motion.of_rows(recorded.motion.rows[few]), wrench=recorded.wrench[few])

    def between(motion: RecordedMotion) -> JudgedMotion:
        return judged(platform, motion, uses(platform, motion))

    found = between(coarse)
    assert found.between_setpoints.reason is None
    assert 0.9 * found.factor < found.between_setpoints.factor <= found.factor
    loaded = coarse.wrench.copy()
    loaded[1, 2] = 5.0
    for changed, text in ((coarse._replace(wrench=loaded), 'the wrench or the base changes'),
                          (coarse._replace(seconds=0.0 * coarse.seconds), 'do not increase')):
        judgement = between(changed)
        assert text in judgement.between_setpoints.reason
        assert text in between_setpoints(judgement)
    snapshot(between_setpoints(found))
    # without velocities no speed ends the setpoints, but the motion between them
    still = between(coarse._replace(motion=Motion(
        coarse.motion.position, coarse.motion.rotation)))
    assert still.factor is None
    assert still.between_setpoints.factor > 0.0


def test_poses_far_out_of_range_are_counted_as_rejected(tmp_path: Path) -> None:
    bag = messages.write_bag(tmp_path / 'bag', (
        ('setpoint/pose', stamp, messages.pose(stamp, (0.0, 0.0, 1e10 if n == 50 else 1.1)))
        for n in range(100) for stamp in [messages.SECOND + 10 * n * messages.MS]))
    found = read_motion(bag, PARAMETERS, Options(cutoff=5.0), lambda size: None)
    assert (len(found.seconds), found.rejected) == (99, 1)


@pytest.mark.parametrize(('changes', 'limit'), [
    ({'limits.length_max': 1.32}, 'length_max'), ({'limits.velocity_max': 0.1}, 'velocity_max'),
    ({'limits.base_joint_angle_max': 0.001}, 'base_joint_angle_max')])
def test_a_motion_that_exceeds_a_limit_is_not_possible(
        changes: dict[str, float], limit: str, recorded: RecordedMotion) -> None:
    platform = StewartPlatform(PARAMETERS.replaced(changes))
    found = judged(platform, recorded, uses(platform, recorded))
    assert not found.possible
    assert found.factor < 1.0
    assert found.limit == limit
    assert found.amplitude.value < 1.0
    # where the path is not possible no payload can be added in it
    assert (found.payload is None) == (found.factor == 0.0) == (limit != 'velocity_max')
    assert (found.between_setpoints is None) == (limit != 'velocity_max')


def test_a_motion_ends_at_the_first_limit_though_it_is_singular_later(
        recorded: RecordedMotion) -> None:
    rows = recorded.motion.rows.copy()
    rows[50:, 3:12] = rotation_about([0.0, 0.0, 1.0], math.pi / 2.0).ravel()
    turned = recorded._replace(motion=Motion.of_rows(rows))
    for longest, limit, sample in ((9.0, 'singularity', 50), (1.0, 'length_max', 0)):
        platform = StewartPlatform(PARAMETERS.replaced(
            {'limits.length_min': 0.1, 'limits.length_max': longest}))
        found = judged(platform, turned, uses(platform, turned))
        assert (found.limit, found.at_s) == (limit, turned.seconds[sample])
        assert found.possible is False
        assert found.factor == 0.0
        assert found.amplitude is found.payload is None


def test_without_a_limit_of_its_speed_a_motion_is_possible_and_can_be_larger(
        recorded: RecordedMotion, snapshot: Snapshot) -> None:
    platform = StewartPlatform(PARAMETERS.replaced({
        'limits.velocity_max': None, 'limits.force_max': None}))
    found = judged(platform, recorded, uses(platform, recorded))
    assert found.possible
    assert found.factor is found.limit is found.payload is None
    assert found.amplitude.value > 1.0
    snapshot(motion_verdict(found))


def test_a_bag_through_a_singularity_is_not_possible(tmp_path: Path) -> None:
    given = '--params', PLATFORM, '--motion', ROOT / 'bags' / 'singular', '--output'
    printed = call(main, *given, tmp_path / 'a', '--strict', code=1)
    assert 'motion not possible: at no speed, by singularity at 8.22' in printed.out
    assert f'results: {tmp_path / "a"}' in printed.out


def heaving_bag(folder: Path, factor: float = 1.0, twist: float = 0.0) -> Path:
    """Write a bag of poses times a factor, with twists times a factor, without accelerations."""
    phase = 0.03 * np.arange(600)[:, None]
    up = np.array([0.0, 0.0, 1.0])
    return messages.write_bag(folder, messages.setpoints(
        messages.NOW + 10 * messages.MS * np.arange(600), Motion(
            factor * (1.1 + 0.05 * np.sin(phase)) * up, np.eye(3),
            twist * 0.15 * np.cos(phase) * up)))


def test_a_motion_in_millimetres_is_named_before_its_twists(tmp_path: Path) -> None:
    bag = heaving_bag(tmp_path / 'bag', 1e3, twist=1.0)
    out = call(main, '--params', PLATFORM, '--motion', bag, '--output', tmp_path / 'a', '--strict',
               code=1).out
    printed = ' '.join(out.split())
    assert ('motion not judged, its messages contradict each other or the parameters: '
            'setpoint/pose: first setpoint: possible error: position in mm; ') in printed
    assert printed.count('possible error') == 1
    assert 'velocity is not the derivative of the poses' in printed


def test_a_motion_whose_twists_are_zero_is_not_judged(tmp_path: Path) -> None:
    heaving_bag(tmp_path / 'bag')
    printed = call(main, '--params', PLATFORM, '--motion', tmp_path / 'bag', '--output',
                   tmp_path / 'a', '--strict', code=1).out
    assert 'motion not judged, its messages contradict each other or the parameters: ' in printed
    assert 'no limit at any speed' not in printed
    motion = json.loads((tmp_path / 'a' / 'datasheet.json').read_text())['motion']
    assert len(motion['mistakes']) == 2
    assert all(each.endswith('it is zero, never filled?') for each in motion['mistakes'])
    page = (tmp_path / 'a' / 'datasheet.html').read_text()
    assert 'not judged, its messages contradict each other or the parameters' in page
    assert '<p>setpoint/twist: velocity is not the derivative' in page
    assert 'payload that can be added' not in page


class _Loaded(HTMLParser):
    """Resources and scripts of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.bold = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.bold += 'onerror' in given
        if tag == 'script' or given.get('src') or (tag == 'link' and given['href'] != 'data:,'):
            self.found.append(tag)


def test_the_page_loads_nothing_and_names_are_text(tmp_path: Path) -> None:
    p = PARAMETERS.replaced({
        'joints': ['<img src=x onerror=a>', 'b"', "c'", 'd&', 'e</svg>', 'f'],
        'limits.velocity_max': 0.1, 'limits.base_joint_angle_max': 0.4})
    p.to_yaml(tmp_path / 'a.yaml')
    call(main, '--params', tmp_path / 'a.yaml', '--output', tmp_path / 'sheet')
    text = (tmp_path / 'sheet' / 'datasheet.html').read_text()
    page = _Loaded(text)
    assert not page.found
    assert not page.bold
    assert text.count('<svg') == text.count('</svg>')
    assert 'nan' not in text.lower().replace('nanum', '')


@pytest.mark.skipif(not BROWSER, reason='there is no chromium')
def test_the_page_fits_a_phone_and_two_sheets_of_paper(sheet: Path) -> None:
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(
            executable_path=BROWSER, args=['--no-sandbox', '--disable-gpu'])
        page = browser.new_page()
        page.goto((sheet / 'datasheet.html').as_uri())
        for width in (390, 820, 1140, 1440):
            page.set_viewport_size({'width': width, 'height': 900})
            assert page.evaluate('document.documentElement.scrollWidth') <= width
            overlaps = page.evaluate(
                '[...document.querySelectorAll("table")].filter(each => !each.closest(".scroll")'
                ' && each.offsetWidth > each.parentElement.clientWidth + 1).map(each => '
                'each.innerText.slice(0, 40) + each.offsetWidth)')
            assert not overlaps
            # what goes on behind an edge has a shadow there
            assert set(page.evaluate(
                '[...document.querySelectorAll(".scroll")].map('
                'each => getComputedStyle(each).backgroundAttachment)')) == {
                    'local, local, scroll, scroll'}
        pdf = page.pdf(prefer_css_page_size=True)
        assert b'/Count 2' in pdf
        browser.close()


def test_a_stiffness_in_another_unit_is_a_possible_error(snapshot: Snapshot) -> None:
    assert not [*soft_legs(PARAMETERS, 5e7), *soft_legs(PARAMETERS, None)]
    (found,) = soft_legs(PARAMETERS, 50.0)
    snapshot(found)
    assert found.endswith('in N/um, or in N/mm?')


def mistakes_in(option: str, values: Any) -> list[str]:
    """Return the possible errors in the units of an option."""
    if option == '--box':
        return [*doubtful_ranges(np.array(values, dtype=float), PARAMETERS)]
    if option == '--pose':
        return [*find_option_errors(PARAMETERS, {option: values}, {})]
    return [*find_option_errors(PARAMETERS, {}, {option: values, '--given': None})]


@pytest.mark.parametrize(('option', 'values'), [
    ('--pose', (0, 0, 1180, 0, 0, 0)), ('--pose', (0, 0, 1.18, 5, 0, 0)),
    ('--pose', (10, 0, 1180, 0, 0, -8)), ('--pose', (0, 0, 0.02, 2, 0, 0)),
    ('--pivot', (0, 0, 800)), ('--payload', (0, 0, 200)),
    ('--box', [[0, 50], [0, 0], [0, 0], [0, 0], [0, 0], [0, 0]]),
    ('--box', [[0, 0], [0, 0], [0, 0], [-5, 0], [0, 0], [0, 0]])])
def test_units_of_poses_and_points_in_options_are_judged(
        option: str, values: Any, snapshot: Snapshot) -> None:
    found, = mistakes_in(option, values)
    assert found.startswith(f'{option}: ')
    snapshot(found)


@pytest.mark.parametrize(('option', 'values'), [
    ('--pose', (0, 0, 1.18, 0.1, 0, 0)), ('--pose', (0, 0, 1.5, 0.9, 0, 0)),
    ('--pivot', (0, 0, 2.5)), ('--payload', (1.0, 0, 1.0)), ('--box', np.full((6, 2), 0.1))])
def test_right_units_in_options_are_no_possible_errors(option: str, values: Any) -> None:
    assert mistakes_in(option, values) == []


def test_a_possible_error_in_a_pose_comes_before_the_error_that_follows(
        tmp_path: Path, snapshot: Snapshot) -> None:
    pose, pivot, error = call(main, '--params', PLATFORM, '--output', tmp_path / 'sheet', '--pose',
                              0, 0, 1180, 0, 0, 0, '--pivot', 0, 0, 100, code=2).err.splitlines()
    snapshot(pose)
    snapshot(pivot)
    snapshot(error)


BAD: list[tuple[list[str], str]] = [
    ['--pose', '0', '0', '2', '0', '0', '0'],
    ['--pose', '0', '0', '1.18', '0', '0', '1.5707963'],
    ['--payload', '0', '0', '0', '0'],
    ['--payload', '1', '0', '0', '1e6'],
    ['--pivot', '0', '-1000', '0'],
    ['--payload', '9e4', '0', '0', '0'],
    ['--leg-stiffness', '-1'],
    ['--motion', 'none'],
    ['--box', 'none'],
    ['--output', '/proc/none'],
    ['--params', 'none']]


@pytest.mark.parametrize('arguments', BAD, ids=' '.join)
def test_bad_input_is_exit_code_2_and_one_line(
        arguments: list[str], tmp_path: Path, snapshot: Snapshot) -> None:
    given = {'--params': [PLATFORM], '--output': [tmp_path / 'sheet'], arguments[0]: arguments[1:]}
    error = call(main, *(text for option, values in given.items() for text in (option, *values)),
                 code=2).err
    *_, last = error.splitlines()
    assert last.startswith('stewart_capability: ')
    snapshot(last)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize('arguments', [
    ('--pose', 'a', 0, 0, 0, 0, 0), ('--differentiate', 1e300), ('--differentiate', 1e-300)])
def test_arguments_that_are_no_usable_numbers_are_rejected(
        arguments: tuple[Any, ...], snapshot: Snapshot) -> None:
    snapshot(call(main, '--params', PLATFORM, *arguments, code=2).err)


@pytest.mark.parametrize('text', [
    'x: 0.0', 'q: 1.0', 'x: [0.1, -0.1]', 'x: [1, 2, 3]', 'x: .nan', 'x: far', '', '[]',
    'x: [-1.7e308, 1.7e308]', 'rx: 20'])
def test_a_box_that_is_none_is_rejected(text: str, tmp_path: Path, snapshot: Snapshot) -> None:
    (tmp_path / 'box.yaml').write_text(text)
    given = '--params', PLATFORM, '--box', tmp_path / 'box.yaml', '--output', tmp_path / 'a'
    snapshot(call(main, *given, code=2).err)


def test_a_box_that_is_not_reachable_names_its_worst_displacement(tmp_path: Path) -> None:
    (tmp_path / 'box.yaml').write_text('x: [0.2, 0.8]\nry: 0.1\n')
    given = '--box', tmp_path / 'box.yaml', '--output'
    printed = call(main, '--params', PLATFORM, *given, tmp_path / 'a', '--strict', code=1).out
    box = json.loads((tmp_path / 'a' / 'datasheet.json').read_text())['box']
    assert box['displacement']['x'] == pytest.approx(0.8)
    assert abs(box['displacement']['ry']) == pytest.approx(0.1)
    assert [box['displacement'][axis] for axis in ('y', 'z', 'rx', 'rz')] == [0.0] * 4
    assert f'({box["leg"]}) exceeded by {down(1e3 * box["excess"])} mm at x ' in printed
    assert '−0 ' not in printed


def test_a_box_with_a_singularity_in_it_has_no_excess(snapshot: Snapshot) -> None:
    unlimited = Parameters({name: value for name, value in PARAMETERS.given.items()
                            if not name.startswith('limits.length_')})
    box = np.zeros((6, 2))
    box[3] = -3.0, 3.0
    worst = RatedHexapod(unlimited, Pose([0.0, 0.0, 1.18], np.eye(3))).reachable(box).worst
    assert (worst.limit, worst.leg, finite(worst.excess)) == ('singularity', -1, None)
    snapshot(box_verdict(Box(worst.limit, None, False, None, {}, None, {'rx': 3.0}, [], [])))


@pytest.mark.parametrize('limit', ['length_max', 'leg_clearance_min', 'base_joint_angle_max'])
def test_the_excess_of_a_box_has_the_unit_of_its_limit(limit: str, snapshot: Snapshot) -> None:
    snapshot(box_verdict(Box(limit, 'leg_1', False, None, {}, 0.01, {'x': 0.5}, [], [])))


def test_without_limits_there_is_no_datasheet_and_ratings_without_theirs_are_left_out(
        tmp_path: Path) -> None:
    def stripped(*kept: str) -> Path:
        values = {name: value for name, value in PARAMETERS.given.items()
                  if not name.startswith('limits.') or name in kept}
        Parameters(values).to_yaml(tmp_path / 'a.yaml')
        return tmp_path / 'a.yaml'

    given = '--pose', 0, 0, 1.18, 0, 0, 0, '--output'
    error = call(main, '--params', stripped(), *given, tmp_path / 'a', code=2).err
    assert 'limits.force_max' in error
    lengths = stripped('limits.length_min', 'limits.length_max')
    call(main, '--params', lengths, *given, tmp_path / 'a')
    found = json.loads((tmp_path / 'a' / 'datasheet.json').read_text())
    assert found['force'] is found['payload'] is found['velocity'] is None
    assert 'Static load' not in (tmp_path / 'a' / 'datasheet.html').read_text()


def test_legs_that_are_too_near_reject_a_pose_and_make_a_motion_impossible(
        recorded: RecordedMotion, snapshot: Snapshot) -> None:
    thick = {'legs.cylinder.radius': 0.03, 'legs.cylinder.length': 0.5, 'legs.piston.radius': 0.02,
             'limits.leg_clearance_min': 0.001}
    p = PARAMETERS.replaced(thick)
    nearest = Capability(StewartPlatform(p)).clearance(recorded.motion)
    for factor, possible in ((0.999, True), (1.001, False)):
        platform = StewartPlatform(p.replaced({
            'limits.leg_clearance_min': factor * float(np.min(nearest))}))
        used = uses(platform, recorded)
        assert judged(platform, recorded, used).possible == possible
    rated = RatedHexapod(p)
    assert rated.clearance() == pytest.approx(rated.loads.clearance(rated.pose))
    assert RatedHexapod(PARAMETERS).clearance() is None
    with snapshot.raises(PoseError):
        RatedHexapod(p.replaced({'limits.leg_clearance_min': 1.0}))


def test_report_and_datasheet_of_a_motion_link_to_each_other(tmp_path: Path) -> None:
    def linked(page: Path) -> list[Path]:
        found = re.findall(r'<a href="([^"#]+html)"', page.read_text())
        return [(page.parent / unquote(each)).resolve() for each in found]

    bag, given = ROOT / 'bags' / 'clear', ('--params', PLATFORM)
    report = tmp_path / 'replayed' / 'clear' / 'report.html'
    call(replay, bag, *given, '--plotly', 'shared', '--output', report.parents[1])
    assert not linked(report)
    sheet = tmp_path / 'datasheet' / 'datasheet.html'
    call(main, *given, '--motion', bag, '--output', sheet.parent)
    assert linked(sheet) == [report]
    # not with other parameters
    other = tmp_path / 'other.yaml'
    PARAMETERS.replaced({'platform.mass': 151.0}).to_yaml(other)
    elsewhere = tmp_path / 'of_other' / 'datasheet.html'
    call(main, '--params', other, '--motion', bag, '--output', elsewhere.parent)
    assert not linked(elsewhere)
    call(replay, bag, '--params', other, '--plotly', 'shared', '--output', tmp_path / 'b')
    assert not linked(tmp_path / 'b' / 'clear' / 'report.html')
    call(replay, bag, *given, '--plotly', 'shared', '--output', report.parents[1], '--force')
    assert linked(report) == [sheet]


def test_rejected_messages_of_a_motion_are_counted(snapshot: Snapshot) -> None:
    motion = read_motion(ROOT / 'bags' / 'flawed', PARAMETERS, Options(), lambda size: None)
    snapshot(setpoints_used(len(motion.seconds), motion.rejected))


@pytest.mark.parametrize(('source', 'payload'), [
    ('fixed', ('', 3.0)), ('pose', (', base in any orientation', 2.0))])
def test_the_payload_of_a_base_that_turns_is_that_of_any_orientation(
        source: str, payload: tuple[str, float]) -> None:
    assert rated_payload(
        HeldPayload(None, None, 3.0, 2.0), {'base.source': source}) == payload


def test_results_are_replaced_only_by_option(sheet: Path, snapshot: Snapshot) -> None:
    snapshot(call(main, '--params', PLATFORM, '--output', sheet, code=2).err)


@pytest.mark.parametrize(('value', 'text'), [
    (0.0, '0'), (1.23456, '1.234'), (-1.23456, '−1.234'), (99999.0, '99\u202f990'),
    (0.1, '0.1000'), (2.3, '2.300'), (1234.0, '1\u202f234'), (math.inf, '–'), (None, '–'),
    (1e-5, '0.00001000'), (9999999999.0, '9\u202f999\u202f000\u202f000'), (1e10, '1.000e+10'),
    (-1.79e308, '−1.790e+308'), (1e-299, '1.000e−299'), (5e-324, '4.940e−324')])
def test_figures_are_rounded_toward_zero(value: float | None, text: str) -> None:
    assert down(value) == text


def test_ranges_that_look_equal_are_written_once() -> None:
    unit = LINEAR['travel']
    write: Callable[[float, float], str] = lambda low, high: both_ways(  # noqa: E731
        Translations(*(Rating(None, None, each) for each in 3 * (high, low))), 'x', unit)
    assert write(0.1, 0.10001) == '±100.0'
    assert write(0.1, 0.2) == '−100.0\u00a0… +200.0'


@pytest.mark.parametrize('gravity', [
    (0.0, 0.0, -9.8), (0.0, 0.0, 9.8), (5.0, 0.0, -8.0), (0.0, 9.8, 0.0), (-9.8, 0.0, 0.0),
    (1.0, 2.0, 3.0)])
def test_up_in_a_drawing_is_opposite_to_gravity(gravity: tuple[float, float, float]) -> None:
    axes = upright(np.array(gravity))
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert np.allclose(axes @ gravity, [0.0, 0.0, -np.linalg.norm(gravity)])


def _corners(svg: str, plate: str) -> Array:
    """Return the corners (N, 2) of a plate in a picture, from its upper left corner [px]."""
    (path,) = re.findall(rf'<path d="([^"]*)" class="plate {plate}"', svg)
    return np.array(re.findall(r'-?[\d.]+', path), dtype=float).reshape(-1, 2)


def test_a_hanging_hexapod_is_drawn_below_its_base_and_seen_from_below() -> None:
    home = StewartPlatform(PARAMETERS).home_pose()
    hanging = PARAMETERS.replaced({'gravity': [0.0, 0.0, 9.80665]})
    for p, name in ((PARAMETERS, 'Top view'), (hanging, 'View from below')):
        drawing = Drawing(p, home)
        front, plan = drawing.front().svg(), drawing.top().svg()
        below = _corners(front, 'moving')[:, 1].min() > _corners(front, 'base')[:, 1].max()
        assert below == (p is hanging)
        assert name in plan
        assert plan.index('class="plate base"') < plan.index('class="plate moving"')
        assert '>1181<' in front
    tilted = PARAMETERS.replaced({'gravity': [9.80665, 0.0, 0.0]})
    assert '>1181<' not in Drawing(tilted, home).front().svg()  # z is horizontal


def test_plates_are_drawn_with_their_outlines_to_scale() -> None:
    def square(half: float) -> list[float]:
        return [half, half, 0.0, -half, half, 0.0, -half, -half, 0.0, half, -half, 0.0]

    p = PARAMETERS.replaced({
        'geometry.base_outline': square(1.5), 'geometry.platform_outline': square(0.5)})
    plan = Drawing(p, StewartPlatform(p).home_pose()).top().svg()
    base, moving = (np.ptp(_corners(plan, name), axis=0) for name in ('base', 'moving'))
    assert base[0] == pytest.approx(base[1], abs=0.1)
    assert base == pytest.approx(3.0 * moving, abs=0.2)
    front = Drawing(p, StewartPlatform(p).home_pose()).front().svg()
    assert np.ptp(_corners(front, 'base')[:, 0]) == pytest.approx(3.0 * moving[0], rel=0.2)


def test_hull_and_ticks() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0.0]])
    assert sorted(map(tuple, hull(square))) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert ticks(-1.05, 2.1, 3) == pytest.approx([0.0, 2.0])
    assert ticks(0.0, 0.0, 3) == [0.0]


# Camera hexapod of the Rubin Observatory, [mm]: coordinates of the ends of its struts, their
# stroke, the pivot and the position limits of its controller, from constants.py of
# https://github.com/lsst-ts/ts_mthexapod (1ba8f97).
MOVING = [(227.6, 653.8), (-227.6, 653.8), (-680.0, -129.7), (-452.3, -524.0), (452.3, -524.0),
          (680.0, -129.7)]
FIXED = [(472.8, 512.2), (-472.8, 512.2), (-680.0, 153.3), (-207.2, -665.5), (207.2, -665.5),
         (680.0, 153.3)]
PUBLISHED = {'x': 0.0114, 'y': 0.0114, 'z': 0.0131, 'rx': math.radians(0.36),
             'ry': math.radians(0.36), 'rz': math.radians(0.1)}


def test_a_published_hexapod_reaches_each_of_its_limits_alone_but_not_all_at_once() -> None:
    moving = 1e-3 * np.array([(*each, -525.0) for each in MOVING])
    fixed = 1e-3 * np.array([(*each, -121.4) for each in FIXED])
    lengths = np.linalg.norm(moving - fixed, axis=1)
    rated = RatedHexapod(Parameters({
        'geometry.base_joints': fixed, 'geometry.platform_joints': moving, 'platform.mass': 1.0,
        'platform.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
        'limits.length_min': lengths - 0.0141, 'limits.length_max': lengths + 0.0141}),
        Pose(np.zeros(3), np.eye(3)), np.array([0.0, 0.0, -2.7584]))
    box = np.array([[-PUBLISHED[axis], PUBLISHED[axis]] for axis in AXES])
    for n, axis in enumerate(AXES):
        alone = np.zeros((6, 2))
        alone[n] = box[n]
        assert rated.reachable(alone).certain, axis
    found = rated.reachable(box)
    assert not found.certain
    assert found.worst.excess == pytest.approx(0.0200, abs=1e-4)
    assert rated.reachable_factor(box).value == pytest.approx(
        0.4173, abs=1e-4)


def test_a_stuck_leg_is_on_the_sheet_where_it_is_asked_for(tmp_path: Path) -> None:
    out = call(main, '--params', PLATFORM, '--stuck', 'leg_3', '--output', tmp_path / 'sheet').out
    assert 'leg_3 stuck: five motions remain' in out
    found = json.loads((tmp_path / 'sheet' / 'datasheet.json').read_text())['stuck_leg']
    assert found['leg'] == 'leg_3' and len(found['motions']) == 5
    c = Capability(StewartPlatform.from_yaml(PLATFORM))
    expected = c.stuck_leg(c.platform.home_pose(), 2)
    assert expected.load is not None and expected.payload is not None
    for n, row in enumerate(found['motions']):
        assert row['motion'] == pytest.approx(expected.motions[n], abs=1e-9)
        for side, sign in enumerate('+-'):
            assert row[f'load{sign}']['value'] == pytest.approx(expected.load.value[n, side])
    assert found['payload']['value'] == pytest.approx(expected.payload.value)
    page = (tmp_path / 'sheet' / 'datasheet.html').read_text()
    assert 'leg_3 stuck: five motions remain' in page
    error = call(main, '--params', PLATFORM, '--stuck', 'leg_7', '--output', tmp_path / 'b',
                 code=2).err
    assert error == (
        "stewart_capability: --stuck: 'leg_7': must be one of leg_1, leg_2, leg_3, leg_4, leg_5, "
        'leg_6\n')

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

"""The page of the moving base: its programs run, its tables and files are those of the code."""

from __future__ import annotations

from contextlib import redirect_stdout
import io
import math
import re
from typing import Any

import messages
import numpy as np
import pytest
from referees import ROOT, rotation_about
from scipy.spatial.transform import Rotation

from stewart_dynamics import BaseMotion, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.rows import BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION
from stewart_dynamics.parameters.yaml_file import flat, read_document
from stewart_dynamics.setpoints.base import BaseInput
from stewart_dynamics.setpoints.inputs import BASE_IMU, BASE_SOURCES
from stewart_dynamics.setpoints.rejections import Rejections
import yaml

PAGE = (ROOT / 'docs' / 'moving_base.md').read_text(encoding='utf-8')
CONFIG = ROOT / 'config'
# File, name of the node, and source of the motion of its base.
FILES = (('telescope.yaml', '', 'pose'), ('ship_hexapod.yaml', '', 'imu'),
         ('stacked.yaml', 'lower_hexapod', 'fixed'), ('stacked.yaml', 'upper_hexapod', 'motion'))
SECOND = 1_000_000_000


def hexapod(file: str, node: str = '') -> StewartPlatform:
    """Return a hexapod of config/."""
    return StewartPlatform(Parameters.from_yaml(CONFIG / file, node))


def cells(table: str) -> list[list[str]]:
    """Return the rows of a table on the page."""
    text = PAGE.partition(f'<!-- {table} -->\n')[2].partition(f'<!-- end of {table} -->')[0]
    return [[cell.strip() for cell in line.strip('|').split(' | ')]
            for line in text.strip().splitlines()[2:]]


def numbers(cell: str) -> list[float]:
    """Return the numbers in a cell."""
    return [float(each) for each in re.findall(r'-?\d+(?:\.\d+)?', cell)]


def base_input(parameters: Parameters, **changes: Any) -> BaseInput:
    """Return the input that follows the topics of the base."""
    return BaseInput(parameters.replaced({
        name.replace('__', '.'): value for name, value in changes.items()}),
        Rejections(lambda *why: pytest.fail(f'{why}')), pytest.fail)


def test_the_programs_on_the_page_print_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = re.findall(r'```python\n(.*?)```\n```text\n(.*?)```', PAGE, flags=re.DOTALL)
    assert len(parts) == PAGE.count('```python') == 2
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    for code, expected in parts:
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(code, 'moving_base.md', 'exec'), names)
        assert printed.getvalue() == expected


@pytest.mark.parametrize(('file', 'node', 'source'), FILES)
def test_the_files_describe_hexapods_without_likely_mistakes(
        file: str, node: str, source: str) -> None:
    platform = hexapod(file, node)
    assert platform.parameters['base.source'] == source
    assert platform.check() == ()
    assert f'`{file}`' in PAGE
    result = platform.inverse_dynamics(Motion.from_pose(platform.home_pose()))
    assert result.condition_number < 5.0


def test_what_the_page_quotes_is_in_the_files() -> None:
    quoted = [yaml.safe_load(text) for text in re.findall(
        r'```yaml\n(.*?)```', PAGE, flags=re.DOTALL)]
    assert len(quoted) == 3
    for content, file in zip(quoted, ('telescope', 'ship_hexapod', 'stacked'), strict=True):
        document = read_document(CONFIG / f'{file}.yaml')
        if file != 'stacked':
            content = {'/**': {'ros__parameters': content}}
        for node, section in content.items():
            given = dict(flat(document[node]['ros__parameters'], '', file))
            assert dict(flat(section['ros__parameters'], '', file)).items() <= given.items()


def test_the_ship_has_the_hexapod_of_the_package() -> None:
    own, given = (Parameters.from_yaml(CONFIG / file) for file in (
        'platform.yaml', 'ship_hexapod.yaml'))
    changed = {name: given[name] for name in Parameters.table if name.startswith('base.')}
    assert own.replaced(changed) == given


def test_the_files_of_stacked_hexapods_fit_the_remaps_on_the_page() -> None:
    lower, upper = (hexapod('stacked.yaml', f'{name}_hexapod').parameters
                    for name in ('lower', 'upper'))
    assert upper['world_frame'] == lower['base_frame']
    assert upper['base_frame'] == lower['platform_frame']
    assert lower['setpoint.source'] == 'separate'
    file = (CONFIG / 'stacked.yaml').read_text(encoding='utf-8')
    for topic in BASE_SOURCES['motion']:
        remap = f"-r '~/{topic}:=/lower_hexapod/setpoint/{topic.partition('/')[2]}'"
        assert remap in PAGE
        assert remap in file


def test_setpoints_of_the_lower_hexapod_are_the_motion_of_the_upper_ones_base() -> None:
    upper = hexapod('stacked.yaml', 'upper_hexapod').parameters
    turn = rotation_about(np.array([2.0, -1.0, 2.0]) / 3.0, 0.4)
    carrier = Motion([0.1, 0.2, 1.1], turn, [0.3, 0.1, -0.2], [0.1, 0.4, -0.3], [1.0, 2.0, 0.5],
                     [-2.0, 1.0, 3.0])
    base = base_input(upper)
    twist, accel = (tuple(carrier.rows[n:n + 6].tolist()) for n in (12, 18))
    quaternion = Rotation.from_matrix(turn).as_quat()
    given = (messages.pose(SECOND, (0.1, 0.2, 1.1), quaternion, 'ground'),
             messages.twist(SECOND, twist, 'ground'), messages.accel(SECOND, accel, 'ground'))
    for topic, data in zip(BASE_SOURCES['motion'], given, strict=True):
        base.take(topic, data, lambda: 0)
    assert np.allclose(base.at(SECOND), BaseMotion.from_motion(carrier).rows, rtol=0.0, atol=1e-13)


def test_the_base_wrench_of_the_upper_hexapod_loads_the_lower_one_as_a_payload() -> None:
    """With massless legs, held still on the carrier, it is a rigid body on it."""
    lower, upper = (hexapod('stacked.yaml', f'{name}_hexapod') for name in ('lower', 'upper'))
    massless = StewartPlatform(upper.parameters.replaced({
        f'legs.{part}.{name}': 0.0 for part in ('cylinder', 'piston') for name in (
            'mass', 'inertia')}))
    turn = rotation_about(np.array([1.0, 2.0, 2.0]) / 3.0, 0.2)
    stage = Motion.from_pose(Pose([0.02, -0.01, 0.78], turn))
    carrier = Motion.from_euler([0.1, 0.0, 1.18], [0.1, -0.05, 0.2], [0.2, 0.1, 0.0],
                                [0.3, 0.2, -0.4], [0.5, -1.0, 2.0], [2.0, -1.0, 1.0])
    load = massless.base_wrench(stage, base=BaseMotion.from_motion(carrier))
    wrench = np.concatenate([carrier.rotation @ load[:3], carrier.rotation @ load[3:]])

    def inertia(parameters: Parameters) -> Any:
        xx, xy, xz, yy, yz, zz = parameters['platform.inertia']
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def about(point: Any, mass: float, center: Any, tensor: Any) -> Any:
        arm = center - point
        return tensor + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    own, its = lower.parameters, upper.parameters
    m, n = own['platform.mass'], its['platform.mass']
    c = own['platform.center_of_mass']
    d = stage.position + stage.rotation @ its['platform.center_of_mass']
    center = (m * c + n * d) / (m + n)
    both = about(center, m, c, inertia(own)) + about(
        center, n, d, stage.rotation @ inertia(its) @ stage.rotation.T)
    one = StewartPlatform(own.replaced({
        'platform.mass': m + n, 'platform.center_of_mass': center,
        'platform.inertia': both[np.triu_indices(3)]}))
    assert np.allclose(lower.inverse_dynamics(carrier, wrench=wrench).forces,
                       one.inverse_dynamics(carrier).forces, rtol=0.0, atol=1e-9)


def test_the_forces_of_the_telescope_are_those_on_the_page() -> None:
    platform = hexapod('telescope.yaml')
    home = Motion.from_pose(Pose([0.0, 0.0, 0.45], np.eye(3)))
    table = cells('forces of the telescope')
    assert len(table) == 4
    forces = []
    for elevation, gravity, legs in table:
        half = 0.5 * math.radians(270.0 - numbers(elevation)[0])
        tube = Pose.from_quaternion(np.zeros(3), [0.0, math.sin(half), 0.0, math.cos(half)])
        base = BaseMotion.from_pose(tube, platform.parameters['gravity'])
        assert np.allclose(base.gravity, numbers(gravity), rtol=0.0, atol=0.00501)
        forces.append(platform.inverse_dynamics(home, base=base).forces)
        assert np.allclose(forces[-1], numbers(legs), rtol=0.0, atol=0.501)
    wrong, = re.findall(r'wrong by up to (\d+) N', PAGE)
    assert float(wrong) == round(np.abs(np.array(forces) - forces[0]).max())


@pytest.mark.parametrize('row', cells('errors of extrapolation'), ids=lambda row: row[0])
def test_the_errors_of_extrapolation_are_those_on_the_page(row: list[str]) -> None:
    """Evaluate the angular acceleration of a sine, just before the next sample."""
    (frequency,), (rate,), (held,), (extrapolated,) = (numbers(cell) for cell in (
        row[0].partition(',')[0], *row[1:]))
    period = round(SECOND / rate)
    base = base_input(hexapod('stacked.yaml', 'upper_hexapod').parameters)

    def of(stamp: int) -> float:
        return math.sin(2e-9 * math.pi * frequency * stamp)

    errors = []
    for n in range(1, math.ceil(rate / frequency) + 2):
        stamp = n * period
        given = (messages.pose(stamp, frame='ground'), messages.twist(stamp, frame='ground'),
                 messages.accel(stamp, (of(stamp), 0.0, 0.0, 0.0, 0.0, 0.0), 'ground'))
        for topic, data in zip(BASE_SOURCES['motion'], given, strict=True):
            base.take(topic, data, lambda: 0)
        then = stamp + period
        found = base.at(then)
        assert found is not None
        if n > 1:
            errors.append([abs(of(stamp) - of(then)),
                           abs(found[BASE_ACCELERATION.start] - of(then))])
    worst = 100.0 * np.max(errors, axis=0)
    step = 2.0 * math.sin(math.pi * frequency / rate)
    assert np.allclose(worst, [100.0 * step, 100.0 * step * step], rtol=0.02)
    assert np.allclose(worst, [held, extrapolated], rtol=0.04)


@pytest.mark.parametrize('row', cells('delay and noise of the filter'), ids=lambda row: row[0])
def test_delay_and_noise_of_the_angular_acceleration_are_those_on_the_page(
        row: list[str]) -> None:
    """Pass a ramp, and white noise, through the node's own filter."""
    (rate,), (cutoff,), (delay,), (noise,) = (
        numbers(cell.partition('^')[0]) for cell in row)
    parameters = Parameters.from_yaml(CONFIG / 'platform.yaml')
    random, period = np.random.default_rng(1), SECOND // round(rate)

    def rows(spins: Any) -> Any:
        base = base_input(parameters, base__source='imu', base__imu__cutoff=cutoff)
        for n, spin in enumerate(spins):
            base.take(BASE_IMU, messages.imu((n + 1) * period, (spin, 0.0, 0.0)), lambda: 0)
            assert base.last is not None
            yield base.last[1][BASE_ANGULAR_ACCELERATION.start]

    times = np.arange(round(rate)) / rate
    *_, last = rows(0.5 * times ** 2)  # its angular acceleration is the time
    assert 1e3 * (times[-1] - last) == pytest.approx(delay, abs=0.06)
    found = np.std(list(rows(1e-3 * random.standard_normal(4000)))[100:])
    assert found == pytest.approx(noise, rel=0.05)
    k = -math.expm1(-2.0 * math.pi * cutoff / rate)
    assert 1e3 / rate * (1.0 / k - 0.5) == pytest.approx(delay, abs=0.051)
    assert 1e-3 * k * rate * math.sqrt(2.0 / (2.0 - k)) == pytest.approx(noise, abs=0.00051)

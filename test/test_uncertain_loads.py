# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Loads on the hexapods that a file admits: deviations by the regressor, counts, the replay."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from legs_of_all_kinds import efforts_of, KINDS, random_hexapod
from msgspec import to_builtins
import numpy as np
from programs import call
import pytest
from referees import ROOT
from stewart_dynamics import ParameterError, Parameters, StewartPlatform
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.datasheet.uncertain_payload import uncertain_payload
from stewart_dynamics.estimation.uncertainty import root_of_covariance
from stewart_dynamics.gpu import Hexapods
from stewart_dynamics.gpu.uncertain_structures import (
    uncertain_parameters, uncertain_structures)
from stewart_dynamics.mechanics.dynamics.linear_parameters import linear_parameters
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.replay import main
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.replay.uncertain_loads import UncertainLoads
from stewart_dynamics.setpoints.step import Batch, FIRST, Step

SMALL = {'uncertainty.platform_mass': 0.01, 'uncertainty.center_of_mass': 1e-3,
         'uncertainty.inertia': 0.02, 'uncertainty.leg_mass': 0.02,
         'uncertainty.reflected_mass': 0.03, 'uncertainty.tilt': 2e-3}
PLATFORM = ROOT / 'config' / 'platform.yaml'


def loads(p: Parameters, rows: Any, count: int, parts: int = 1) -> tuple[UncertainLoads, Any]:
    """Return the loads of motions, added in parts, and the bands."""
    found, bands = UncertainLoads(p, count), []
    for part in np.array_split(np.arange(len(rows)), parts):
        setpoints = Batch.from_parts(10_000_000 * part, rows[part])
        outputs = Step(p)(setpoints, FIRST)
        none = np.zeros((len(part), 6))
        bands.append(found.add(Answered(part * 0.01, setpoints, outputs, none, none)))
    return found, np.concatenate(bands)


def by_body(p: Parameters, size: int) -> Any:
    """Return the derivatives of the linear parameters by mass, center and inertia (n, n)."""
    found = np.eye(size)
    columns = [('platform.mass', None), *(('platform.center_of_mass', n) for n in range(3)),
               *(('platform.inertia', n) for n in range(6))]
    for column, (name, at) in enumerate(columns):
        ends = []
        for sign in (1.0, -1.0):  # quadratic at most: exact
            value = np.array(p[name], dtype=float)
            value[() if at is None else at] += sign * 0.01 * np.abs(p[name]).max()
            ends.append(linear_parameters(p.replaced({name: value})))
        found[:, column] = (ends[0] - ends[1]) / (0.02 * np.abs(p[name]).max())
    return found


@pytest.mark.parametrize('kind', KINDS)
def test_deviations_are_those_of_the_covariance(kind: str) -> None:
    """Efforts are linear in the parameters: their covariance follows from the regressor."""
    p, motion = random_hexapod(kind, 31, 5)
    p = p.replaced(SMALL)
    count = 4000
    found = Hexapods(p, count, uncertainty=1, device='cpu').inverse_dynamics(
        motion.rows[:, None])
    efforts = getattr(found, p.leg_kind.effort.field)
    regressor = StewartPlatform(p).regressor(motion, tilt=True).matrix
    size = regressor.shape[-1] - 2
    root = regressor[..., :size] @ by_body(p, size) @ root_of_covariance(
        p, p.platform.body, np.zeros(size))
    tilts = p.uncertainty.tilt * regressor[..., size:]
    expected = np.sqrt((root ** 2).sum(axis=-1) + (tilts ** 2).sum(axis=-1))
    # The deviation of a deviation of 4000 samples is 1.1 %: four of them.
    np.testing.assert_allclose(efforts.std(axis=1), expected, rtol=0.045)
    mean = efforts.mean(axis=1) - efforts_of(p, motion)
    assert np.abs(mean / expected).max() < 4.5 / np.sqrt(count) + 0.01


def test_equal_seeds_give_equal_hexapods() -> None:
    p = Parameters.from_yaml(PLATFORM)
    one, same, other = (uncertain_structures(p, 70, seed) for seed in (1, 1, 2))
    assert np.array_equal(one['mass'], same['mass'])
    assert not np.array_equal(one['mass'], other['mass'])
    assert (one['mass'] > 0.0).all()  # with the default deviation every fiftieth would not be
    assert np.linalg.eigvalsh(one['inertia'][:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]).min() > 0.0


def test_deviations_that_no_hexapod_keeps() -> None:
    p = Parameters.from_yaml(PLATFORM).replaced({'uncertainty.inertia': 1e9,
                                                 'uncertainty.leg_mass': 1e9})
    with pytest.raises(ParameterError, match='uncertainty'):
        uncertain_structures(p, 4)


@pytest.mark.parametrize('kind', KINDS)
def test_parameters_are_those_of_the_structures(kind: str) -> None:
    p = Parameters.from_yaml(ROOT / 'config' / (
        'platform.yaml' if kind == 'telescopic' else 'crank_platform.yaml'))
    for each, one in zip(uncertain_parameters(p, 10, 3), uncertain_structures(p, 10, 3),
                         strict=True):
        other = limited_structure(each)
        for name in ('mass', 'center_of_mass', 'inertia', 'gravity'):
            assert np.array_equal(other[name], one[name])
        for name in other['legs'].dtype.names:
            assert np.array_equal(other['legs'][name], one['legs'][name], equal_nan=True), name


def test_a_heavier_platform_carries_less() -> None:
    """Where the center of mass is at the pivot, platform and payload are one mass for all."""
    p = Parameters.from_yaml(PLATFORM).replaced({
        **dict.fromkeys(SMALL, 0.0), 'uncertainty.platform_mass': 0.1,
        'platform.center_of_mass': [0.0, 0.0, 0.0]})
    hexapod = RatedHexapod(p)
    found = uncertain_payload(hexapod, 40).payload
    alone = float(hexapod.loads.payload(hexapod.pose, np.zeros(3)).value)
    masses = [each.platform.mass - p.platform.mass for each in uncertain_parameters(p, 40)]
    high, middle, low = np.percentile(masses, [2.5, 50.0, 97.5])
    np.testing.assert_allclose(
        [found.low, found.median, found.high],
        [alone - low, alone - middle, alone - high], rtol=1e-9)
    weak = RatedHexapod(p.replaced({'limits.force_max': 350.0}))
    expected = float(weak.loads.payload(weak.pose, np.zeros(3)).value)
    assert 0.0 <= expected < 20.0
    overloaded = uncertain_payload(weak, 40).overloaded
    assert overloaded == sum(each >= expected for each in masses)
    assert 0 < overloaded < 40


@pytest.mark.parametrize('kind', KINDS)
def test_exceeding_hexapods_are_counted(kind: str) -> None:
    """Each hexapod by itself, and whatever the parts in which setpoints come."""
    p, motion = random_hexapod(kind, 33, 40)
    p = p.replaced({**SMALL, 'uncertainty.platform_mass': 0.1})
    efforts = getattr(
        Hexapods(p, 200, uncertainty=0, device='cpu').inverse_dynamics(motion.rows[:, None]),
        p.leg_kind.effort.field)
    limit = float(np.quantile(np.abs(efforts).max(axis=(0, 2)), 0.97))
    p = p.replaced({p.leg_kind.effort_limit: limit})
    found, bands = loads(p, motion.rows, 200)
    values = to_builtins(found.values())
    counted = {each['limit']: each for each in values['limits']}
    assert counted[p.leg_kind.effort_limit]['hexapods'] == 6
    assert counted[p.leg_kind.effort_limit]['share'] == 0.03
    low, _, high = np.percentile(efforts, [2.5, 50.0, 97.5], axis=1)
    np.testing.assert_array_equal(bands, np.concatenate([low, high], axis=1))
    other, others = loads(p, motion.rows, 200, parts=7)
    assert to_builtins(other.values()) == values
    assert np.array_equal(others, bands)


def test_limits_of_motors_are_counted() -> None:
    p = Parameters.from_yaml(PLATFORM).replaced({
        **SMALL, 'uncertainty.platform_mass': 0.2, 'actuator.screw_lead': 0.01,
        'drive.torque_max': 1.0})
    home = StewartPlatform(p).home_pose()
    rows = np.zeros((3, 24))
    rows[:, :12] = home.rows
    found, _ = loads(p, rows, 100)
    counted = {each.limit: each.hexapods for each in found.values().limits}
    hexapods = Hexapods(p, 100, uncertainty=0, device='cpu')
    torques = np.abs(hexapods.inverse_dynamics(rows[0]).forces) * 0.01 / (2.0 * np.pi)
    assert counted['drive.torque_max'] == int((torques > 1.0).any(axis=1).sum())
    p = p.replaced({'drive.torque_max': float(np.median(torques.max(axis=1)))})
    found, _ = loads(p, rows, 100)
    counted = {each.limit: each.hexapods for each in found.values().limits}
    assert counted['drive.torque_max'] == 50


def test_replay_states_bands(tmp_path: Path) -> None:
    arguments = [str(ROOT / 'bags' / 'clear'), '--params', str(PLATFORM), '--output']
    text = call(main, *arguments, tmp_path / 'with', '--uncertainty', '20').out
    assert 'in 95 % of 20 hexapods that the file admits' in text
    assert 'limits.force_max is held in all 20 hexapods that the file admits' in text
    assert 'uncertainty.* are not given: the defaults are weak' in text
    folder = tmp_path / 'with' / 'clear'
    summary = json.loads((folder / 'summary.json').read_text())
    for leg, found in summary['uncertainty']['legs'].items():
        peak = abs(summary['legs'][leg]['force_peak_n'])
        assert found['force_peak_n_low'] < peak < found['force_peak_n_high']
        assert found['force_margin_n_low'] == pytest.approx(
            summary['parameters']['limits.force_max'][0] - found['force_peak_n_high'])
    page = (folder / 'report.html').read_text()
    assert '<section id="uncertainty">' in page
    assert 'on the hexapods that the file admits' in page
    call(main, *arguments, tmp_path / 'without')
    plain = json.loads((tmp_path / 'without' / 'clear' / 'summary.json').read_text())
    assert plain['uncertainty'] is None
    assert plain['legs'] == summary['legs']
    assert '<section id="uncertainty">' not in (
        tmp_path / 'without' / 'clear' / 'report.html').read_text()

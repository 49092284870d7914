# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The vectorized environment of the examples, and the search of gains, on a CPU."""

from __future__ import annotations

from pathlib import Path
import sys
from typing import Any

import numpy as np
import pytest
from referees import ROOT
from stewart_dynamics import Motion, StewartPlatform

pytest.importorskip('gymnasium')
sys.path.insert(0, str(ROOT / 'examples'))
from hexapod_env import (  # noqa: E402, I100, I202
    errors_of, HexapodEnv, main, rule_of_thumb, search, TASKS)

FILES = {'telescopic': ROOT / 'config' / 'platform.yaml',
         'crank': ROOT / 'config' / 'crank_platform.yaml'}


def environment(legs: str = 'telescopic', count: int = 6, task: str = 'follow', **given: Any,
                ) -> HexapodEnv:
    given = {'seconds': 0.1, 'device': 'cpu', **given}
    return HexapodEnv(StewartPlatform.from_yaml(FILES[legs]), count, task, **given)


@pytest.mark.parametrize('task', TASKS)
@pytest.mark.parametrize('legs', FILES)
def test_episodes_begin_again(legs: str, task: str) -> None:
    env = environment(legs, task=task)
    first, _ = env.reset(seed=3)
    assert env.observation_space.contains(first)
    assert not first.any()  # at rest where the motions begin
    ends = []
    for n in range(2 * env.length):
        observation, reward, terminated, truncated, info = env.step(np.zeros((6, 6)))
        assert observation.shape == (6, 18)
        assert reward.shape == terminated.shape == truncated.shape == (6,)
        assert (reward <= 0.0).all()
        assert not terminated.any()
        if truncated.any():
            ends.append(n)
            assert truncated.all()
            assert np.abs(info['final_obs']).max() > 1e-4  # the payloads are not known
            assert not observation.any()
    assert ends == [env.length - 1, 2 * env.length - 1]


def test_without_payload_the_feed_forward_follows() -> None:
    """The motion is the one that the forces are computed for, but for the hold of a period."""
    env = environment(payload=0.0, seconds=0.3)
    env.reset(seed=1)
    for _ in range(env.length - 1):
        _, _, _, _, info = env.step(np.zeros((6, 6)))
    assert np.abs(info['errors']).max() < 1e-3
    with_payload = environment(seconds=0.3)
    with_payload.reset(seed=1)
    for _ in range(env.length - 1):
        _, _, _, _, other = with_payload.step(np.zeros((6, 6)))
    assert np.abs(other['errors']).max() > 5.0 * np.abs(info['errors']).max()


def test_a_lost_hexapod_begins_again_alone() -> None:
    env = environment(seconds=1.0)
    env.reset(seed=2)
    action = np.zeros((6, 6))
    action[4] = 3.0
    while True:
        observation, _, terminated, truncated, info = env.step(action)
        if terminated.any():
            break
        assert not truncated.any()
    assert terminated.tolist() == [False] * 4 + [True, False]
    assert info['_final_obs'].tolist() == terminated.tolist()
    assert not observation[4].any()
    assert observation[0].any()


def test_the_same_seed_gives_the_same_motions() -> None:
    actions = np.random.default_rng(5).uniform(-0.1, 0.1, (20, 6, 6))
    ends = []
    for seed in (7, 7, 8):
        env = environment(task='push', seconds=0.5, noise=(1e-6, 1e-4))
        env.reset(seed=seed)
        for action in actions:
            observation, *_ = env.step(action)
        ends.append(observation)
    assert np.array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])


def test_a_step_response_is_that_of_the_plant() -> None:
    """A constant extra force accelerates the platform as the forward dynamics say."""
    platform = StewartPlatform(StewartPlatform.from_yaml(FILES['telescopic']).parameters.replaced(
        {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}))
    env = HexapodEnv(platform, 2, 'hold', payload=0.0, device='cpu')
    env.reset()
    action = np.zeros((2, 6))
    action[1, 2] = 0.01
    observation, *_ = env.step(action)
    home = Motion.from_pose(platform.home_pose())
    forces = platform.inverse_dynamics(home).forces + env.scale * action[1]
    found = platform.forward_dynamics(home, forces)
    expected = env.period * np.concatenate([
        found.linear_acceleration, found.angular_acceleration])
    np.testing.assert_allclose(observation[1, 12:], expected,
                               atol=1e-4 * np.abs(expected).max())
    assert np.abs(observation[0, 12:]).max() < 1e-12


def test_the_search_finds_better_gains() -> None:
    env = environment(count=64, seconds=0.2, noise=(2e-6, 2e-4), period=1e-3)
    start = rule_of_thumb(StewartPlatform.from_yaml(FILES['telescopic']))
    gains, errors = search(env, start, 2, 4)
    assert errors[-1] < 0.5 * errors[0]
    tried = errors_of(env, np.tile(gains, (64, 1)))
    assert np.sqrt(np.mean(tried ** 2)) < errors[0]


def test_the_program_writes_parameters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'gains.yaml'
    monkeypatch.setattr(sys, 'argv', [
        'hexapod_env', '--params', str(FILES['telescopic']), '--hexapods', '32', '--trials', '4',
        '--rounds', '1', '--seconds', '0.05', '--device', 'cpu', '--output', str(file)])
    main()
    assert 'after 1 rounds' in capsys.readouterr().out
    text = file.read_text()
    assert text.startswith('leg_controller:\n  ros__parameters:\n    proportional_gain: ')


@pytest.mark.parametrize('given', [['--params', 'missing.yaml'], ['--device', 'tpu']])
def test_errors_are_one_line(given: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, 'argv', ['hexapod_env', *given, '--hexapods', '16'])
    with pytest.raises(SystemExit, match='^hexapod_env: [^\n]+$'):
        main()

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: many simulated hexapods as a vectorized environment of Gymnasium, and a search of gains.

HexapodEnv simulates hexapods with payloads that the controller does not know, on a GPU or a CPU:
to hold a pose, to follow a motion, or to hold against a push. Observations, actions and rewards
are arrays where the hexapods are: of numpy, or of cupy, which PyTorch and JAX take by DLPack.

As a program it searches the gains of examples/leg_controller.py, by the cross-entropy method:
each hexapod tries gains of its own. --output is a parameter file of leg_controller.
"""

import argparse
import sys
from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode
import numpy as np
from stewart_dynamics import Motion, StewartError, StewartPlatform
from stewart_dynamics.gpu import Hexapods

TASKS = 'hold', 'follow', 'push'
# Largest amplitudes [m, rad] and range of frequencies [Hz] of the motions, along X Y Z and yaw.
AMPLITUDE, FREQUENCY = np.array([0.03, 0.03, 0.02, 0.05]), (0.5, 2.0)
PUSH, PUSH_BEGIN, PUSH_TIME = 0.3, 0.2, 0.5  # by the weight; [s]


class HexapodEnv(gymnasium.vector.VectorEnv):
    """
    Hexapods that follow a motion; the action is added to the forces of the node.

    Observation (18,): error of the drives' positions [m, rad], of their rates [m/s, rad/s], and
    the platform's twist [m/s, rad/s]. Action (6,): efforts of the drives by ``scale`` [N, N m],
    added to those that the desired motion needs without the payload. Reward: minus the mean square
    of the errors by ``tolerance`` [m, rad], and of the action. An episode ends after ``seconds``,
    or where the motion of a hexapod cannot be computed or an error exceeds ``most``.

    payload: largest mass by that of the platform; each hexapod has one of its own, at a place of
    its own. noise: standard deviations of observed positions and rates.
    """

    metadata = {'autoreset_mode': AutoresetMode.SAME_STEP, 'render_modes': []}

    def __init__(self, platform: StewartPlatform, num_envs: int, task: str = 'follow', *,
                 payload: float = 0.25, seconds: float = 2.0, period: float = 0.002,
                 tolerance: float = 1e-3, most: float = 0.1,
                 noise: tuple[float, float] = (0.0, 0.0), seed: int = 0, device: str = '') -> None:
        if task not in TASKS:
            raise ValueError(f'task: {task}: must be one of {", ".join(TASKS)}')
        parameters, random = platform.parameters, np.random.default_rng(seed)
        self.num_envs, self.task, self.tolerance, self.most = num_envs, task, tolerance, most
        self.noise, self.kind = noise, parameters.leg_kind
        mass = parameters.carried.mass
        arm = 0.3 * parameters.singularity.characteristic_length
        self.hexapods = Hexapods(platform, num_envs, {
            'payload.mass': random.uniform(0.0, max(payload, 1e-12), num_envs) * mass,
            'payload.center_of_mass': random.uniform(-arm, arm, (num_envs, 3)),
        } if payload > 0.0 else None, device=device)
        self.model = Hexapods(platform, num_envs, device=device)  # the one that the node knows
        self.xp = xp = self.hexapods.xp
        self.steps = max(1, round(period / self.hexapods.step_length))
        self.period = self.steps * self.hexapods.step_length
        self.length = max(1, round(seconds / self.period))
        home = platform.home_pose()
        self.home = xp.asarray(home.rows)
        at_rest = platform.inverse_dynamics(Motion.from_pose(home))
        efforts = getattr(at_rest, self.kind.effort.field)
        self.scale = float(np.abs(efforts).max())
        self.weight = mass * float(np.linalg.norm(parameters.gravity))
        box = gymnasium.spaces.Box
        self.single_observation_space = box(-np.inf, np.inf, (18,), np.float64)
        self.single_action_space = box(-1.0, 1.0, (6,), np.float64)
        self.observation_space = box(-np.inf, np.inf, (num_envs, 18), np.float64)
        self.action_space = box(-1.0, 1.0, (num_envs, 6), np.float64)
        self._seed = seed

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None,
              ) -> tuple[Any, dict[str, Any]]:
        """Put all hexapods at rest at home, with motions and pushes of their own."""
        xp = self.xp
        self.random = xp.random.default_rng(self._seed if seed is None else seed)
        self.amplitude, self.omega = xp.zeros((self.num_envs, 4)), xp.ones((self.num_envs, 4))
        self.force, self.count = xp.zeros((self.num_envs, 6)), xp.zeros(self.num_envs)
        self._begin(xp.ones(self.num_envs, dtype=bool))
        return self._observe(), {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply actions (N, 6) for a period."""
        xp = self.xp
        time = self.count * self.period
        pushed = (time >= PUSH_BEGIN) & (time < PUSH_BEGIN + PUSH_TIME)
        self.hexapods.step(
            self.forward + self.scale * actions, xp.where(pushed[:, None], self.force, 0.0),
            steps=self.steps)
        self.count += 1.0
        self._desire()
        errors = self._errors()
        terminated = self.hexapods.states.faulty | (xp.abs(errors).max(axis=1) > self.most)
        truncated = ~terminated & (self.count >= self.length)
        reward = -(errors ** 2).mean(axis=1) / self.tolerance ** 2
        reward -= 1e-3 * (actions ** 2).mean(axis=1)
        info: dict[str, Any] = {'errors': errors}
        over = terminated | truncated
        observation = self._observe()
        if bool(over.any()):
            info |= {'final_obs': observation, '_final_obs': over}
            self._begin(over)
            observation = xp.where(over[:, None], self._observe(), observation)
        return observation, reward, terminated, truncated, info

    def _begin(self, chosen: Any) -> None:
        """Begin an episode of the hexapods that are chosen."""
        xp, count = self.xp, self.num_envs
        follow, push = self.task == 'follow', self.task == 'push'
        of_motion = self.random.random((2, count, 4))
        low, high = FREQUENCY
        for to, new in (
                (self.amplitude, follow * xp.asarray(AMPLITUDE) * (of_motion[0] - 0.5)),
                (self.omega, 2.0 * np.pi * (low + (high - low) * of_motion[1])),
                (self.force, push * PUSH * self.weight * xp.concatenate([
                    2.0 * self.random.random((count, 3)) - 1.0, xp.zeros((count, 3))], axis=1))):
            to[...] = xp.where(chosen[:, None], new, to)
        self.count = xp.where(chosen, 0.0, self.count)
        self.hexapods.reset(chosen)
        self._desire()

    def _desire(self) -> None:
        """Compute the desired motions: A (1 - cos(w t)) along each axis, from rest at home."""
        xp, time = self.xp, (self.count * self.period)[:, None]
        cosine, sine = xp.cos(self.omega * time), xp.sin(self.omega * time)
        value = self.amplitude * (1.0 - cosine)
        rate = self.amplitude * self.omega * sine
        acceleration = self.amplitude * self.omega ** 2 * cosine
        rows = xp.zeros((self.num_envs, 24))
        rows[:, :12] = self.home
        rows[:, :3] += value[:, :3]
        c, s = xp.cos(value[:, 3]), xp.sin(value[:, 3])
        for n in range(3):
            x, y = self.home[3 + n], self.home[6 + n]
            rows[:, 3 + n], rows[:, 6 + n] = c * x - s * y, s * x + c * y
        rows[:, 12:15], rows[:, 17] = rate[:, :3], rate[:, 3]
        rows[:, 18:21], rows[:, 23] = acceleration[:, :3], acceleration[:, 3]
        found = self.model.inverse_dynamics(rows, condition=False, singular='nan')
        self.positions, self.rates, self.forward = (
            getattr(found, each.field) for each in (
                self.kind.position, self.kind.rate, self.kind.effort))

    def _errors(self) -> Any:
        return self.positions - self.hexapods.states.positions

    def _observe(self) -> Any:
        xp, states = self.xp, self.hexapods.states
        noise = self.random.standard_normal((2, self.num_envs, 6)) if any(self.noise) else (0, 0)
        return xp.concatenate([
            self._errors() - self.noise[0] * noise[0],
            self.rates - states.rates - self.noise[1] * noise[1], states.twist], axis=1)


def errors_of(env: HexapodEnv, gains: Any) -> Any:
    """Return the root mean square error of each hexapod (N,) under gains of its own (N, 2)."""
    xp = env.xp
    observation, _ = env.reset()
    squares, lost = xp.zeros(env.num_envs), xp.zeros(env.num_envs, dtype=bool)
    for _ in range(env.length):
        action = gains[:, :1] * observation[:, :6] + gains[:, 1:] * observation[:, 6:12]
        observation, _, terminated, _, info = env.step(action / env.scale)
        lost |= terminated
        squares += xp.where(lost, 0.0, (info['errors'] ** 2).mean(axis=1))
    return xp.where(lost, xp.inf, xp.sqrt(squares / env.length))


def search(env: HexapodEnv, start: tuple[float, float], rounds: int, trials: int,
           seed: int = 0) -> tuple[np.ndarray, list[float]]:
    """
    Return the best gains (2,) of position and rate, and the error of the mean of each round.

    Gains are drawn from normal distributions of their logarithms; each is tried by ``trials``
    hexapods. The next distribution is that of the best tenth.
    """
    random, count = np.random.default_rng(seed), env.num_envs // trials
    mean, deviation = np.log(start), np.full(2, 1.0)
    found, of_rounds = np.asarray(start), []
    best = np.inf
    for _ in range(rounds):
        tried = np.exp(mean + deviation * random.standard_normal((count, 2)))
        tried[0] = np.exp(mean)
        gains = env.xp.asarray(np.repeat(tried, trials, axis=0))
        errors = errors_of(env, gains)
        errors = np.asarray(errors.get() if hasattr(errors, 'get') else errors)
        of_each = np.sqrt(np.mean(errors[:count * trials].reshape(count, trials) ** 2, axis=1))
        order = np.argsort(of_each)
        of_rounds.append(float(of_each[0]))
        if of_each[order[0]] < best:
            best, found = float(of_each[order[0]]), tried[order[0]]
        elite = np.log(tried[order[:max(2, count // 10)]])
        mean, deviation = elite.mean(axis=0), elite.std(axis=0) + 1e-3
    return found, [*of_rounds, best]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--params', default='config/platform.yaml', help='of the hexapod')
    parser.add_argument('--hexapods', type=int, default=1024, help='%(default)s; on a GPU 65536')
    parser.add_argument('--trials', type=int, default=16, help='hexapods of a pair of gains')
    parser.add_argument('--rounds', type=int, default=4, help='of the search (%(default)s)')
    parser.add_argument('--seconds', type=float, default=1.0, help='of an episode (%(default)s)')
    parser.add_argument('--period', type=float, default=1e-3, help='of control (%(default)s s)')
    parser.add_argument('--task', choices=TASKS, default='follow')
    parser.add_argument('--device', default='', help='cpu, cuda or cuda:N; by default any GPU')
    parser.add_argument('--output', help='parameter file of leg_controller, to be written')
    options = parser.parse_args()
    if min(options.hexapods // max(options.trials, 1), options.trials, options.rounds) < 1:
        parser.error('--hexapods, --trials, --rounds: at least one pair of gains is needed')
    try:
        platform = StewartPlatform.from_yaml(options.params)
        env = HexapodEnv(platform, options.hexapods // options.trials * options.trials,
                         options.task, seconds=options.seconds, device=options.device,
                         period=options.period, noise=(2e-6, 2e-4))
        start = rule_of_thumb(platform)
        gains, errors = search(env, start, options.rounds, options.trials)
    except (StewartError, OSError) as exc:
        sys.exit(f'hexapod_env: {exc}')
    unit = env.kind.position.unit
    print(f'{env.hexapods}: gains {start[0]:.4g}, {start[1]:.4g}: error {errors[0]:.3g} {unit}')
    print(f'after {options.rounds} rounds: {gains[0]:.4g}, {gains[1]:.4g}: '
          f'error {errors[-1]:.3g} {unit}')
    if options.output:
        with open(options.output, 'w', encoding='utf-8') as file:
            file.write('leg_controller:\n  ros__parameters:\n'
                       f'    proportional_gain: {float(gains[0])!r}\n'
                       f'    derivative_gain: {float(gains[1])!r}\n')


def rule_of_thumb(platform: StewartPlatform) -> tuple[float, float]:
    """Return the gains that leg_controller has by default: 8 Hz, damping ratio 1."""
    home = platform.home_pose()
    to_twist = np.linalg.inv(platform.drive_jacobian(home))
    mass = float(np.diag(to_twist.T @ platform.mass_matrix(home) @ to_twist).max())
    omega = 2.0 * np.pi * 8.0
    return mass * omega ** 2, 2.0 * mass * omega


if __name__ == '__main__':
    main()

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The way back, forces to accelerations and lengths to poses: how fast, and from how far away.

Run by hand, ``make bench``; see README.md beside this file.
"""

from __future__ import annotations

from typing import Any

from inverse_dynamics import (
    Contestant, example_hexapod, Figure, measure, measured_on, microseconds, once, random_motions,
    ratio, repeated, STILL, table, Tree)
import numpy as np
import pinocchio as pin
from scipy.optimize import root

from stewart_dynamics import Motion, Pose, StewartPlatform
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.dynamics import forward_dynamics
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.kinematics.forward_kinematics import FOUND
from stewart_dynamics.mechanics.rows import DETERMINANT, FORCES

BEGIN, END = '<!-- forward: begin -->', '<!-- forward: end -->'

HOME = np.array([0.0, 0.0, 1.1])
FAR, FAR_ANGLE = 0.2 * HOME[2], 0.2
GUESSES = 1_000_000
SAMPLES = 20_000
ABA = '`pin.aba` alone'
CALL = '`StewartPlatform.forward_dynamics`, one `Motion`'
NEWTON = 'the function in C alone, from afar'
FROM_POSE = '`StewartPlatform.forward_kinematics` from afar, guess a `Pose`'


def turns_about(axes: Any, angle: float) -> Any:
    """Return rotations by an angle about axes (N, 3) of any length (Rodrigues)."""
    k = np.cross(axes[:, None] / np.linalg.norm(axes, axis=-1)[:, None, None], np.eye(3))
    k = np.swapaxes(k, -1, -2)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def legal_poses(platform: StewartPlatform, random: np.random.Generator, many: int) -> Motion:
    """Return poses all over the workspace that results/forward.md states."""
    p, found = platform.parameters, []
    while sum(map(len, found)) < many:
        motion = Motion(
            HOME + random.uniform(-0.6, 0.6, (many, 3)),
            from_euler(random.uniform(-1.0, 1.0, (many, 3)) * np.radians([20.0, 20.0, 30.0])))
        lengths = platform.inverse_kinematics(motion)
        legal = np.all((lengths >= p.limits.length_min)
                       & (lengths <= p.limits.length_max), axis=-1)
        found.append(motion.rows[legal])
    rows = np.concatenate(found)[:many]
    return Motion(rows[:, :3], rows[:, 3:12].reshape(-1, 3, 3))


def far_from(motion: Motion, random: np.random.Generator) -> Motion:
    """Return guesses as far from poses as Newton's method is asked to come from."""
    way, axis = random.normal(size=(2, len(motion.rows), 3))
    way *= FAR / np.linalg.norm(way, axis=-1, keepdims=True)
    return Motion(motion.position + way, turns_about(axis, FAR_ANGLE) @ motion.rotation)


def steps_table(platform: StewartPlatform) -> list[str]:
    """Return the lines of a table of how many steps Newton's method takes, and where it fails."""
    random = np.random.default_rng(20260103)
    poses = legal_poses(platform, random, GUESSES)
    guesses = far_from(poses, random)
    lengths = platform.inverse_kinematics(poses)
    rows = guesses.rows.copy()
    codes, steps = np.empty(GUESSES, dtype=np.int64), np.empty(GUESSES, dtype=np.int64)
    residuals = np.empty(GUESSES)
    forward_kinematics.poses(platform.structure, lengths, rows, codes, steps, residuals)
    found = codes == FOUND
    determinants = [platform.solve(each.rows)[:, DETERMINANT] for each in (poses, guesses)]
    beyond = determinants[0] * determinants[1] <= 0.0
    right = found & np.all(np.abs(rows[:, :12] - poses.rows[:, :12]) < 1e-9, axis=-1)
    shares = [*((f'arrive in at most {most} steps', found & (steps <= most))
                for most in (4, 5, 6, 10)),
              ('lie beyond a singularity themselves', beyond),
              ('do not, and arrive nowhere', ~found & ~beyond),
              ('do not, and arrive at another pose', found & ~right & ~beyond)]
    return ['| of a million guesses, 20 % of the height and 0.2 rad away | % |', '| --- | ---: |',
            *(f'| {what} | {100.0 * np.mean(which):.3f} |' for what, which in shares),
            '', f'Largest residual of a pose found: {residuals[found].max():.1e} m.']


def contestants(platform: StewartPlatform) -> tuple[list[Contestant], ...]:
    """Return the contestants: forward dynamics, single and in batches, and forward kinematics."""
    motion = random_motions(SAMPLES)
    forces = platform.solve(motion.rows)[:, FORCES].copy()
    one = Motion(motion.position[0], motion.rotation[0], motion.linear_velocity[0],
                 motion.angular_velocity[0])
    row, force, no_wrench = motion.rows[:1].copy(), forces[:1].copy(), np.zeros((1, 6))
    tree = Tree(platform.parameters)
    q, v, _, _ = tree.state(one)
    dynamics = [
        Contestant('the function in C alone', repeated(
            'solve()', solve=function('forward_dynamics_many').bound(
                platform.structure, 1, row, force, 1, no_wrench, 1, STILL)), ABA),
        Contestant(ABA, repeated(
            'aba(model, data, q, v, tau)', aba=pin.aba, model=tree.model, data=tree.data, q=q,
            v=v, tau=np.zeros(tree.model.nv)), ABA),
        Contestant(CALL, repeated(
            'solve(motion, forces)', solve=platform.forward_dynamics, motion=one,
            forces=forces[0]), ABA),
        Contestant(f'`forward_dynamics.solve`, a sample of {SAMPLES:,}', once(
            SAMPLES, forward_dynamics.solve, platform.structure, motion.rows.copy(), forces,
            no_wrench, STILL), ABA)]

    random = np.random.default_rng(20260103)
    pose = legal_poses(platform, random, 1)
    guess = far_from(pose, random)
    lengths = platform.inverse_kinematics(pose)
    codes, steps, residuals = np.empty(1, dtype=np.int64), np.empty(1, dtype=np.int64), np.empty(1)

    def newton(begin: Any) -> Any:
        rows = begin.copy()
        return repeated(
            'rows[:] = begin; find()', find=function('forward_kinematics_many').bound(
                platform.structure, 1, lengths, rows, codes, steps, residuals),
            rows=rows, begin=begin)

    near = pose.rows.copy()
    near[0, :3] += [1e-4, -2e-4, 1e-4]  # 0.2 m/s at 1 kHz

    def miss(x: Any) -> Any:
        return platform.inverse_kinematics(Pose.from_euler(x[:3], x[3:])) - lengths[0]

    start = np.concatenate([guess.position[0], np.zeros(3)])
    assert np.max(np.abs(root(miss, start, tol=1e-12).fun)) < 1e-9
    kinematics = [
        Contestant(NEWTON, newton(guess.rows), NEWTON),
        Contestant('the same from the pose of a millisecond before', newton(near), NEWTON),
        *(Contestant(f'`StewartPlatform.forward_kinematics` from afar, guess a `{kind}`', repeated(
            'find(lengths, guess)', find=platform.forward_kinematics, lengths=lengths[0],
            guess=begin), NEWTON) for kind, begin in (
                ('Motion', Motion(guess.position[0], guess.rotation[0])),
                ('Pose', Pose(guess.position[0], guess.rotation[0])))),
        Contestant('`scipy.optimize.root` on `inverse_kinematics`', repeated(
            'root(miss, start, tol=1e-12)', root=root, miss=miss, start=start), NEWTON)]
    return dynamics, kinematics


def run(rounds: int) -> tuple[list[str], list[Figure]]:
    """Measure; return the lines for the page, and the figures with targets."""
    platform = StewartPlatform(example_hexapod())
    dynamics, kinematics = contestants(platform)
    turns = measure(dynamics + kinematics, rounds)
    lines = [
        '', *table('forward dynamics', dynamics, turns),
        '', *table('forward kinematics', kinematics, turns),
        '', *steps_table(platform),
        '', f'{measured_on()} Medians of {rounds} rounds.', '']
    return lines, [
        Figure('`forward_dynamics(motion, forces)`', ratio(CALL, dynamics, turns), 1.5,
               'times `pin.aba`'),
        Figure('`forward_kinematics` with a `Pose`, from afar', microseconds(FROM_POSE, turns),
               6.0, 'us')]

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Many hexapods on a GPU, against the CPU: ``make test-gpu`` on a computer that has one."""

from __future__ import annotations

from typing import Any

from legs_of_all_kinds import KINDS, random_hexapod
import numpy as np
import pytest
from referees import random_wrench, rng
from stewart_dynamics.errors import DeviceError, MotionError
from stewart_dynamics.gpu import Hexapods
from test_gpu import driven, equal, PLATFORM

try:
    from stewart_dynamics.gpu import device as gpu
    gpu.count_devices()
except DeviceError as exc:
    pytest.skip(f'needs a GPU: {exc}', allow_module_level=True)

cupy: Any = pytest.importorskip('cupy')


@pytest.mark.parametrize('kind', KINDS)
def test_a_million_motions_have_the_bits_of_the_cpu(kind: str) -> None:
    """100 random hexapods with 10^4 motions each, some of them out of reach."""
    machines = [random_hexapod(kind, seed, 50) for seed in range(100)]
    random = rng(1)
    motions = np.stack([motion.rows for _, motion in machines], axis=1)  # sample, hexapod
    motions = np.repeat(motions, 200, axis=0)
    motions[..., :3] += 1e-3 * random.normal(size=motions[..., :3].shape)
    motions[..., 12:] *= random.uniform(0.0, 2.0, motions[..., 12:].shape)
    wrench = np.stack([random_wrench(p, rng(n), 1)[0] for n, (p, _) in enumerate(machines)])
    results = []
    for device, xp in (('cpu', np), ('cuda', cupy)):
        hexapods = Hexapods([p for p, _ in machines], device=device)
        given = xp.asarray(motions), xp.asarray(wrench)
        found = hexapods.inverse_dynamics(*given, singular='nan')
        efforts = getattr(found, machines[0][0].leg_kind.effort.field)
        accelerations = hexapods.forward_dynamics(
            given[0], efforts, given[1], singular='nan')
        positions = hexapods.inverse_kinematics(given[0][..., :12], singular='nan')
        poses = hexapods.forward_kinematics(positions, given[0][..., :12], singular='nan')
        results.append([hexapods.to_host(each) for each in (
            found.rows, accelerations, positions, poses)])
    for one, other in zip(results[0][:3], results[1][:3], strict=True):
        assert equal(one, other)
    # sin and cos of the angles of cranks differ in the last digit.
    difference = np.abs(results[0][3] - results[1][3])
    assert np.nanmax(difference) <= (0.0 if kind == 'telescopic' else 1e-9)
    assert np.isfinite(results[0][0]).all(axis=-1).mean() > 0.5


@pytest.mark.parametrize('kind', KINDS)
def test_limits_are_those_of_the_cpu(kind: str) -> None:
    p, motion = random_hexapod(kind, 3, 1000)
    one, other = (Hexapods(p, 1000, device=device).limits(xp.asarray(motion.rows))
                  for device, xp in (('cpu', np), ('cuda', cupy)))
    assert np.array_equal(one, other.get())


@pytest.mark.parametrize(('kind', 'torques'), [
    ('telescopic', False), ('telescopic', True), ('crank', False)])
def test_steps_have_the_bits_of_the_cpu(kind: str, torques: bool) -> None:
    given = driven(kind, torques)
    commands = rng(3).uniform(0.0, 1.5, (1000, 6)) * (5.0 if torques else 300.0)
    one, other = (Hexapods(given, 1000, device=device) for device in ('cpu', 'cuda'))
    for _ in range(3):
        one.step(commands, steps=100)
        other.step(cupy.asarray(commands), steps=100)
    for first, second in zip(one.states, other.states, strict=True):
        assert np.array_equal(first, second.get())


def test_hexapods_that_do_not_fit_come_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    masses = np.linspace(0.0, 100.0, 5000)
    home = cupy.asarray(np.r_[PLATFORM.home_pose().rows, np.zeros(12)])
    whole = Hexapods(PLATFORM, 5000, {'payload.mass': masses}, device='cuda')
    monkeypatch.setattr(gpu, '_SHARE', 1e7 / cupy.cuda.runtime.memGetInfo()[0])
    parts = Hexapods(PLATFORM, 5000, {'payload.mass': masses}, device='cuda')
    assert isinstance(parts._platforms, np.ndarray)
    assert equal(whole.inverse_dynamics(home).rows.get(), parts.inverse_dynamics(home).rows.get())


def test_arrays_stay_on_the_gpu() -> None:
    p, motion = random_hexapod('telescopic', 2, 20)
    hexapods = Hexapods(p, 20, device='cuda')
    found = hexapods.inverse_dynamics(cupy.asarray(motion.rows)).rows
    assert isinstance(found, cupy.ndarray)
    assert cupy.from_dlpack(found).data.ptr == found.data.ptr
    with pytest.raises(MotionError, match='an array on cpu: must be on cuda:0'):
        hexapods.inverse_dynamics(motion.rows)
    torch = pytest.importorskip('torch')
    given = torch.as_tensor(motion.rows, device='cuda')
    again = torch.from_dlpack(hexapods.inverse_dynamics(given).rows)
    assert again.device.type == 'cuda'
    assert equal(again.cpu().numpy(), found.get())


def test_kernels_run_in_the_present_stream() -> None:
    p, motion = random_hexapod('telescopic', 2, 20)
    hexapods = Hexapods(p, 20, device='cuda')
    rows = cupy.asarray(motion.rows)
    known = hexapods.inverse_dynamics(rows).rows.get()
    with cupy.cuda.Stream(non_blocking=True) as stream:
        found = hexapods.inverse_dynamics(rows, singular='nan').rows
        stream.synchronize()
    assert equal(found.get(), known)


def test_too_little_memory_is_one_line() -> None:
    rows = cupy.broadcast_to(cupy.zeros((1, 24)), (10 ** 10, 1, 24))
    with pytest.raises(DeviceError, match='^inverse_dynamics: too little memory: [^\n]+$'):
        Hexapods(PLATFORM, device='cuda').inverse_dynamics(rows)

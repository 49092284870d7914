# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Many hexapods at once, without a GPU: bits of the library, the kernels' text, arguments, errors.

The text that NVRTC compiles for a GPU is compiled here twice more: by NVRTC, which needs no GPU,
and as C++ for this computer, where threads are a loop, to be run.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
from importlib.util import find_spec
from pathlib import Path
import shutil
import subprocess
from typing import Any

from legs_of_all_kinds import efforts_of, KINDS, random_hexapod
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import random_base_motion, random_wrench, rng, ROOT
from simulated import random_simulated, simulated
from snapshot import Snapshot
from stewart_dynamics import (
    BaseMotion, MotionError, ParameterError, Parameters, StewartPlatform)
from stewart_dynamics.core.binding import CODES, record
from stewart_dynamics.errors import DeviceError, ReachError, StewartError
from stewart_dynamics.gpu import Hexapods
from stewart_dynamics.gpu.cuda_source import cuda_source, OPTIONS
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.simulator.plant import Plant, PlantState
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

PROGRAM = 'gpu'

Array = NDArray[np.float64]

PLATFORM = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')


def bits(array: Any) -> Any:
    """Return the bits of numbers; nan is one number."""
    return np.where(np.isnan(array), np.nan, array).view(np.int64)


def equal(one: Any, other: Any) -> bool:
    return bool(np.array_equal(bits(np.ascontiguousarray(one)), bits(np.ascontiguousarray(other))))


# ---- bits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize('moving', [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize('kind', KINDS)
def test_results_have_the_bits_of_the_library(kind: str, moving: bool) -> None:
    """Several platforms of few motions take the loops of the kernels, many motions the lanes."""
    machines = [random_hexapod(kind, seed, 40) for seed in range(6)]
    wrench = np.stack([random_wrench(p, rng(n), 40) for n, (p, _) in enumerate(machines)])
    base = np.stack([random_base_motion(p, rng(n), 40).rows
                     for n, (p, _) in enumerate(machines)]) if moving else None
    motions = np.stack([motion.rows for _, motion in machines])  # hexapod, sample
    for few in (1, 40):
        hexapods = Hexapods([p for p, _ in machines], device='cpu')
        by_sample = [np.swapaxes(each[:, :few], 0, 1) for each in (motions, wrench)]
        of_base = None if base is None else np.swapaxes(base[:, :few], 0, 1)
        found = hexapods.inverse_dynamics(*by_sample, of_base)
        efforts = getattr(found, machines[0][0].leg_kind.effort.field)
        accelerations = hexapods.forward_dynamics(by_sample[0], efforts, by_sample[1], of_base)
        positions = hexapods.inverse_kinematics(by_sample[0][..., :12])
        poses = hexapods.forward_kinematics(positions, by_sample[0][..., :12])
        for n, (p, motion) in enumerate(machines):
            of = StewartPlatform(p)
            loads = wrench[n, :few], None if base is None else BaseMotion(
                *np.split(base[n, :few], 4, axis=-1))
            known = of.inverse_dynamics(motion[:few], *loads)
            assert equal(found.rows[:, n], known.rows)
            assert equal(accelerations[:, n], of.forward_dynamics(
                motion[:few], efforts[:, n], *loads).rows[:, 18:])
            assert equal(positions[:, n], of.inverse_kinematics(motion[:few]))
            assert equal(poses[:, n], of.forward_kinematics(positions[:, n], motion[:few]).rows)


@pytest.mark.parametrize('kind', KINDS)
def test_limits_are_those_of_the_step(kind: str) -> None:
    p, motion = random_hexapod(kind, 3, 60)
    efforts = np.abs(efforts_of(p, motion))
    p = p.replaced({p.leg_kind.effort_limit: float(np.median(efforts))})
    found = Hexapods(p, 60, device='cpu').limits(motion.rows)
    bit = CODES['STEWART_' + {'telescopic': 'FORCE_MAX', 'crank': 'CRANK_TORQUE_MAX'}[kind]]
    assert np.array_equal(found & bit != 0, efforts > np.median(efforts) * (1.0 + 1e-9))
    assert 0 < np.count_nonzero(found & bit) < found.size


def advanced(plants: list[Plant], commands: Array, periods: int) -> list[PlantState]:
    """Return the states of plants after periods of constant commands (N, 6)."""
    for plant, command in zip(plants, commands.tolist(), strict=True):
        for _ in range(periods):
            plant.advance(tuple(command), (0.0,) * 6)
    return [plant.state for plant in plants]


def assert_states(hexapods: Hexapods, plants: list[Plant]) -> None:
    """Assert that hexapods have the bits of plants."""
    states = hexapods.states
    for n, plant in enumerate(plants):
        of = plant.state
        assert equal(states.position[n], of.pose[:3])
        assert equal(states.quaternion[n], of.pose[3:])
        for name in ('positions', 'rates', 'efforts', 'twist', 'acceleration'):
            assert equal(getattr(states, name)[n], getattr(of, name)), name
        if of.motors:
            assert equal(states.motors[n], np.ravel(of.motors))
        assert bool(states.faulty[n]) == bool(plant.fault)


def driven(kind: str, torques: bool) -> list[SimulatorParameters]:
    """Return hexapods that fall to their end stops, some of them under torques of motors."""
    if kind == 'crank':
        given = Hexapods(StewartPlatform.from_yaml(
            ROOT / 'config' / 'crank_platform.yaml'), device='cpu')._simulated[0]
        return [given.replaced({'platform.mass': mass * given['platform.mass']})
                for mass in (1.0, 1.2)]
    changes: dict[str, Any] = {'commands': 'torque'} if torques else {}
    return [simulated(**changes, platform__mass=mass, actuator__screw_lead=0.01,
                      drive__torque_max=20.0, drive__efficiency=0.8) for mass in (100.0, 101.0)]


@pytest.mark.parametrize(('kind', 'torques'), [
    ('telescopic', False), ('telescopic', True), ('crank', False)])
def test_steps_have_the_bits_of_the_simulator(kind: str, torques: bool) -> None:
    given = driven(kind, torques)
    plants = [Plant(each) for each in given]
    hexapods = Hexapods(given, device='cpu')
    assert_states(hexapods, plants)
    steps = plants[0].steps
    for scale in (0.0, 1.0, 0.4):
        commands = scale * rng(4).uniform(0.5, 1.5, (2, 6)) * (5.0 if torques else 200.0)
        advanced(plants, commands, 60)
        for _ in range(60):
            hexapods.step(commands, steps=steps)
        assert {hexapods.step_length} == {plant._step for plant in plants}
        assert_states(hexapods, plants)
    stops = hexapods.states.efforts
    assert np.isfinite(stops).all()


def test_many_steps_in_a_call_are_as_many_calls() -> None:
    one, other = (Hexapods(random_simulated(5), 3, device='cpu') for _ in range(2))
    commands = rng(6).normal(size=(3, 6))
    one.step(commands, steps=20)
    for _ in range(20):
        other.step(commands)
    assert equal(one.states.twist, other.states.twist)
    assert np.abs(one.states.twist).max() > 0.0


def test_a_faulty_hexapod_is_held_until_it_is_reset() -> None:
    hexapods = Hexapods(PLATFORM, 4, device='cpu')
    pushes = np.zeros((4, 6))
    wrench = np.zeros((4, 6))
    wrench[2, 3] = 1e9  # it turns by more than a step resolves
    hexapods.step(pushes, wrench, steps=3)
    assert hexapods.states.faulty.tolist() == [False, False, True, False]
    held = hexapods.states.position[2].copy()
    states = hexapods.step(pushes, steps=50)
    assert equal(states.position[2], held)
    assert not states.twist[2].any()
    others = states.position[[0, 1, 3]].copy()
    chosen = np.zeros(8, dtype=bool)
    chosen[4] = True
    states = hexapods.reset(chosen[::2])  # of any strides
    assert not states.faulty.any()
    assert equal(states.position[2], PLATFORM.home_pose().position)
    assert equal(states.position[[0, 1, 3]], others)
    assert not equal(others[0], states.position[2])


def test_reset_puts_hexapods_into_given_poses() -> None:
    _, motion = random_hexapod('telescopic', 8, 3)
    p = random_hexapod('telescopic', 8, 3)[0]
    size = float(np.linalg.norm(motion.position[0]))
    hexapods = Hexapods(SimulatorParameters({
        **p.given, 'initial_pose': [0.0, 0.0, size, 0.0, 0.0, 0.0]}), 3, device='cpu')
    states = hexapods.reset(poses=motion.rows[:, :12])
    rotations = np.array([from_quaternion(*q) for q in states.quaternion.tolist()])
    np.testing.assert_allclose(rotations, motion.rows[:, 3:12], atol=1e-14)
    assert equal(states.positions, StewartPlatform(p).inverse_kinematics(motion)) or np.allclose(
        states.positions, StewartPlatform(p).inverse_kinematics(motion), rtol=1e-13, atol=0.0)


# ---- parameters of their own --------------------------------------------------------------------

OWN: dict[str, dict[str, Callable[[Any, Any], Any]]] = {
    'telescopic': {
        'platform.mass': lambda p, r: p['platform.mass'] * r.uniform(0.8, 1.2, 5),
        'payload.mass': lambda p, r: r.uniform(1.0, 50.0, 5),
        'payload.center_of_mass': lambda p, r: r.normal(0.0, 0.1, (5, 3)),
        'legs.piston.mass': lambda p, r: r.uniform(0.0, 5.0, (5, 6)),
        'actuator.viscous_friction': lambda p, r: r.uniform(0.0, 50.0, 5),
        'geometry.base_joints': lambda p, r: (
            p['geometry.base_joints'] + r.normal(0.0, 1e-3, (5, 6, 3))),
        'gravity': lambda p, r: p['gravity'] + r.normal(0.0, 0.1, (5, 3))},
    'crank': {
        'platform.mass': lambda p, r: p['platform.mass'] * r.uniform(0.8, 1.2, 5),
        'legs.rod.length': lambda p, r: p['legs.rod.length'] * (1.0 + r.normal(0.0, 1e-3, (5, 6))),
        'legs.rod.mass': lambda p, r: r.uniform(0.1, 1.0, (5, 6)),
        'actuator.reflected_inertia': lambda p, r: r.uniform(0.0, 0.1, (5, 6)),
        'geometry.platform_joints': lambda p, r: (
            p['geometry.platform_joints'] + r.normal(0.0, 1e-4, (5, 6, 3)))}}


@pytest.mark.parametrize('kind', KINDS)
def test_own_parameters_are_those_of_a_file(kind: str) -> None:
    p, motion = random_hexapod(kind, 11, 5)
    p = p.replaced(dict.fromkeys(('legs.rod.inertia', 'legs.rod.center_of_mass',
                                  'singularity.characteristic_length')) if kind == 'crank' else {
                                      'singularity.characteristic_length': None})
    values = {name: each(p, rng(12)) for name, each in OWN[kind].items()}
    found = Hexapods(p, 5, values, device='cpu').inverse_dynamics(motion.rows, singular='nan')
    for n in range(5):
        own = StewartPlatform(p.replaced({name: value[n] for name, value in values.items()}))
        assert equal(found.rows[n], own.inverse_dynamics(motion[n]).rows)


def test_friction_of_its_own_shortens_the_steps() -> None:
    friction = np.array([0.0, 1e5, 0.0])
    hexapods = Hexapods(PLATFORM, 3, {'actuator.viscous_friction': friction}, device='cpu')
    alone = Hexapods(PLATFORM.parameters.replaced({'actuator.viscous_friction': 1e5}),
                     device='cpu')
    assert hexapods.step_length == alone.step_length
    assert hexapods.step_length < Hexapods(PLATFORM, device='cpu').step_length


def test_the_limit_of_its_own_force_holds() -> None:
    limits = np.array([100.0, 400.0])
    hexapods = Hexapods(PLATFORM, 2, {'limits.force_max': limits}, device='cpu')
    states = hexapods.step(np.full(6, 1e3))
    assert states.efforts.tolist() == [[100.0] * 6, [400.0] * 6]


# ---- arrays -------------------------------------------------------------------------------------


class Foreign:
    """An array of another library, with DLPack alone."""

    def __init__(self, array: Array, device: tuple[int, int] = (1, 0)) -> None:
        self.array, self.device, self.dtype = array, device, array.dtype

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device

    def __dlpack__(self, **options: Any) -> Any:
        return self.array.__dlpack__(**options)


def test_arrays_of_other_libraries_stay_where_they_are() -> None:
    p, motion = random_hexapod('telescopic', 2, 20)
    hexapods = Hexapods(p, 20, device='cpu')
    known = hexapods.inverse_dynamics(motion.rows)
    assert hexapods.inverse_dynamics(Foreign(motion.rows.copy())) == known
    assert np.from_dlpack(known.rows).ctypes.data == known.rows.ctypes.data
    by_columns = np.asfortranarray(motion.rows)
    assert hexapods.inverse_dynamics(by_columns) == known
    wide = np.zeros((20, 48))
    wide[:, ::2] = motion.rows
    own = Hexapods(p, 20, {'platform.mass': np.full(20, p['platform.mass'])}, device='cpu')
    assert own.inverse_dynamics(wide[:, ::2]) == known
    assert own.inverse_dynamics(by_columns) == known


def test_one_row_is_for_all() -> None:
    p, motion = random_hexapod('telescopic', 2, 1)
    found = Hexapods(p, 7, device='cpu').inverse_dynamics(motion.rows[0])
    assert found.rows.shape[0] == 7
    assert np.array_equal(found.rows, np.broadcast_to(found.rows[0], found.rows.shape))


BAD: dict[str, Callable[[Hexapods, Array], object]] = {
    'device': lambda h, m: h.inverse_dynamics(Foreign(m, (2, 1))),
    'dtype': lambda h, m: h.inverse_dynamics(m.astype(np.float32)),
    'integers': lambda h, m: h.inverse_dynamics(m.astype(int)),
    'width': lambda h, m: h.inverse_dynamics(m[:, :23]),
    'rows': lambda h, m: h.inverse_dynamics(m[:2]),
    'strides': lambda h, m: h.inverse_dynamics(np.zeros(
        3, dtype=[('a', 'i1'), ('b', 'f8', 24)])['b']),
    'text': lambda h, m: h.step('stop'),
    'samples': lambda h, m: h.step(np.zeros((4, 3, 6))),
    'other samples': lambda h, m: h.inverse_dynamics(
        np.zeros((4, 3, 24)), np.zeros((2, 3, 6))),
    'steps': lambda h, m: h.step(np.zeros(6), steps=-1),
    'mask': lambda h, m: h.reset(np.zeros(3)),
    'nan in a motion': lambda h, m: h.inverse_dynamics(np.full(24, np.nan)),
    'positions of no pose': lambda h, m: h.forward_kinematics(
        np.full(6, 1e-3), PLATFORM.home_pose().rows),
    'accelerations': lambda h, m: h.forward_dynamics(np.full(24, np.nan), np.zeros(6)),
    'positions': lambda h, m: h.inverse_kinematics(np.full(12, np.nan)),
    'unreachable': lambda h, m: h.inverse_dynamics(np.zeros(24)),
    'count': lambda h, m: Hexapods([PLATFORM, PLATFORM], 3, device='cpu'),
    'no platform': lambda h, m: Hexapods(Path('platform.yaml'), 3, device='cpu'),  # type: ignore
    'name of device': lambda h, m: Hexapods(PLATFORM, 3, device='gpu'),
    'value': lambda h, m: Hexapods(PLATFORM, 3, {'platform.mass': [1.0, -1.0, 1.0]}, device='cpu'),
    'nan': lambda h, m: Hexapods(PLATFORM, 3, {'gravity': np.full((3, 3), np.nan)}, device='cpu'),
    'rule': lambda h, m: Hexapods(
        PLATFORM, 3, {'platform.inertia': np.ones((3, 6))}, device='cpu'),
    'payload': lambda h, m: Hexapods(PLATFORM, 3, {
        'payload.mass': np.ones(3), 'payload.inertia': -np.ones((3, 6))}, device='cpu'),
    'legs': lambda h, m: Hexapods(
        PLATFORM, 3, {'legs.cylinder.mass': np.ones((3, 5))}, device='cpu'),
    'fewer': lambda h, m: Hexapods(PLATFORM, 3, {'platform.mass': np.ones(2)}, device='cpu'),
    'unknown': lambda h, m: Hexapods(PLATFORM, 3, {'platform.mas': np.ones(3)}, device='cpu'),
    'no array': lambda h, m: Hexapods(PLATFORM, 3, {'rate': np.ones(3)}, device='cpu'),
    'other kind': lambda h, m: Hexapods(
        PLATFORM, 3, {'legs.rod.length': np.ones(3)}, device='cpu'),
}


def test_errors(snapshot: Snapshot) -> None:
    hexapods = Hexapods(PLATFORM, 3, device='cpu')
    motions = np.zeros((3, 24))
    for name, call in BAD.items():
        with pytest.raises(StewartError) as error:
            call(hexapods, motions)
        assert '\n' not in f'{error.value}'
        snapshot(f'{name}: {type(error.value).__name__}: {error.value}')


@pytest.mark.parametrize('seed', [-1, 1.5, 'a'])
def test_seeds_that_are_none_are_rejected(seed: Any) -> None:
    with pytest.raises(MotionError, match='^uncertainty: .*: must be an integer of 0 or more$'):
        Hexapods(PLATFORM, 2, uncertainty=seed, device='cpu')


def test_too_little_memory_is_one_line() -> None:
    with pytest.raises(DeviceError, match='^too little memory for the parameters of [^\n]+$'):
        Hexapods(PLATFORM, 10 ** 12, device='cpu')
    rows = np.broadcast_to(np.zeros((1, 24)), (10 ** 12, 1, 24))
    with pytest.raises(DeviceError, match='^inverse_dynamics: too little memory: [^\n]+$'):
        Hexapods(PLATFORM, device='cpu').inverse_dynamics(rows)


def test_errors_have_types() -> None:
    hexapods = Hexapods(PLATFORM, 2, device='cpu')
    with pytest.raises(ReachError):
        hexapods.inverse_dynamics(np.zeros(24))
    with pytest.raises(MotionError):
        hexapods.step(np.zeros(5))
    with pytest.raises(ParameterError):
        Hexapods(PLATFORM, 2, {'platform.mass': np.zeros(2)}, device='cpu')
    assert np.isnan(hexapods.inverse_dynamics(np.zeros(24), singular='nan').rows).all()
    assert (hexapods.limits(np.full(24, np.nan)) == -1).all()


def test_without_a_gpu_the_cpu_computes() -> None:
    """Where CuPy or a driver is missing, one line says so; nothing else is different."""
    try:
        from stewart_dynamics.gpu.device import count_devices
        count = count_devices()
    except DeviceError as exc:
        assert '\n' not in f'{exc}'
        with pytest.raises(DeviceError, match='^no (CuPy|GPU)'):
            Hexapods(PLATFORM, 2, device='cuda')
        assert Hexapods(PLATFORM, 2).device == 'cpu'
    else:
        with pytest.raises(DeviceError, match='no such GPU'):
            Hexapods(PLATFORM, 2, device=f'cuda:{count}')


# ---- the text of the kernels --------------------------------------------------------------------


@pytest.mark.slow
def test_nvrtc_compiles_the_kernels() -> None:
    """For the GPUs of the H100's kind; NVRTC needs no GPU, not even a driver."""
    found = find_spec('nvidia.cuda_nvrtc') if find_spec('nvidia') else None
    if found is None or not found.submodule_search_locations:
        pytest.skip('needs the package nvidia-cuda-nvrtc-cu12')
    nvrtc = ctypes.CDLL(str(next(
        Path(next(iter(found.submodule_search_locations))).glob('lib/libnvrtc.so.*'))))
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    text = cuda_source().encode()
    assert nvrtc.nvrtcCreateProgram(
        ctypes.byref(program), text, b'hexapods.cu', 0, None, None) == 0
    options = [*(each.encode() for each in OPTIONS), b'-arch=sm_90']
    code = nvrtc.nvrtcCompileProgram(
        program, len(options), (ctypes.c_char_p * len(options))(*options))
    nvrtc.nvrtcGetProgramLogSize(program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    nvrtc.nvrtcGetProgramLog(program, log)
    assert code == 0, log.value.decode()
    nvrtc.nvrtcGetCUBINSize(program, ctypes.byref(size))
    binary = ctypes.create_string_buffer(size.value)
    nvrtc.nvrtcGetCUBIN(program, binary)
    for name in ('solve', 'limits', 'accelerate', 'positions', 'poses', 'step'):
        # As CuPy looks for it: not with the types of its arguments in it, as names of C++.
        assert f'\0.text.hexapods_{name}\0'.encode() in binary.raw


# A GPU as C++ has it: threads of a block one after the other.
THREADS = r"""
#include <math.h>
#include <stddef.h>
#include <string.h>
#define __CUDACC_RTC__
#define __global__
#define __noinline__ __attribute__((noinline))
static double __longlong_as_double(long long bits)
{double number; memcpy(&number, &bits, sizeof number); return number;}
static struct {unsigned x;} blockIdx, threadIdx, blockDim = {32}, gridDim = {3};
#undef HUGE_VAL
#undef NAN
"""
CALLS = r"""
#define EACH_THREAD \
  for (blockIdx.x = 0; blockIdx.x < gridDim.x; blockIdx.x++) \
    for (threadIdx.x = 0; threadIdx.x < blockDim.x; threadIdx.x++)
extern "C" void solve_on_threads(
  const stewart_platform * platforms, const int64_t * which, int64_t count,
  const double * motions, const double * wrenches, const double * bases, int64_t width,
  double * results) {
  EACH_THREAD hexapods_solve(
    platforms, which, count, 1, 1, width, motions, 24, 0, 1, wrenches, 6, 0, 1, bases, 12, 0, 1,
    results, 1, 0, count);
}
extern "C" void step_on_threads(
  const stewart_platform * platforms, const void * constants, const int64_t * which,
  int64_t count, double steps, double step, const uint8_t * chosen, const double * commands,
  const double * wrenches, const double * bases, double * states, double * legs,
  double * motors) {
  EACH_THREAD hexapods_step(
    platforms, (const plant_constants *)constants, which, count, steps, step, chosen, commands, 6,
    1, wrenches, 6, 1, bases, 12, 1, states, 1, count, legs, 1, count, motors, 1, count);
}
"""


@pytest.fixture(scope='module')
def threads(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """Return the kernels' text as a library of C++ for this computer."""
    compiler = shutil.which('g++') or shutil.which('clang++')
    if compiler is None:
        pytest.skip('needs a C++ compiler')
    folder = tmp_path_factory.mktemp('threads')
    text = cuda_source()
    text = '\n'.join(line for line in text.splitlines() if not (
        line.startswith('typedef') and line.endswith('_t;')))
    (folder / 'kernels.cpp').write_text(
        '#include <stdint.h>\n' + THREADS + text.replace('NAN __long', 'NAN __builtin_nan("") //')
        + CALLS, encoding='utf-8')
    done = subprocess.run(
        [compiler, '-std=c++20', '-O1', '-fpermissive', '-w', '-fPIC', '-shared',
         '-ffp-contract=off', str(folder / 'kernels.cpp'), '-o', str(folder / 'kernels.so')],
        capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    return ctypes.CDLL(str(folder / 'kernels.so'))


def addresses(*values: Any) -> list[Any]:
    """Return what ctypes passes for arrays and numbers."""
    return [value.ctypes.data_as(ctypes.c_void_p) if isinstance(value, np.ndarray)
            else ctypes.c_double(value) if isinstance(value, float) else ctypes.c_int64(value)
            for value in values]


@pytest.mark.slow
@pytest.mark.parametrize('kind', KINDS)
def test_the_kernels_text_gives_the_bits_of_the_library(
        kind: str, threads: ctypes.CDLL) -> None:
    machines = [random_hexapod(kind, seed, 50) for seed in range(20, 26)]
    structures = np.concatenate([
        Hexapods(p, device='cpu')._structures for p, _ in machines])
    rows = np.concatenate([motion.rows for _, motion in machines])
    wrench = np.concatenate([random_wrench(p, rng(n), 50) for n, (p, _) in enumerate(machines)])
    base = np.concatenate([random_base_motion(p, rng(n), 50).rows
                           for n, (p, _) in enumerate(machines)])
    which = np.repeat(np.arange(6), 50)
    width = record('stewart_result').itemsize // 8
    found = np.empty((width, len(rows)))
    threads.solve_on_threads(*addresses(
        structures, which, len(rows), rows, wrench, base, width, found))
    for n, (p, motion) in enumerate(machines):
        of = slice(50 * n, 50 * n + 50)
        known = StewartPlatform(p).inverse_dynamics(
            motion, wrench[of], BaseMotion(*np.split(base[of], 4, axis=-1)))
        assert equal(found.T[of, :known.rows.shape[1]], known.rows)


@pytest.mark.slow
@pytest.mark.parametrize(('kind', 'torques'), [
    ('telescopic', False), ('telescopic', True), ('crank', False)])
def test_the_kernels_text_steps_with_the_bits_of_the_simulator(
        kind: str, torques: bool, threads: ctypes.CDLL) -> None:
    given = driven(kind, torques)
    known = Hexapods(given, 10, device='cpu')
    known.reset()
    state, legs, motors = (np.array(each, order='F') for each in (
        known._state, known._of_legs, known._motors))
    commands = rng(3).uniform(0.5, 1.5, (10, 6)) * (5.0 if torques else 200.0)
    threads.step_on_threads(*addresses(
        known._structures, known._constants, known._which, 10, 40.0, known.step_length,
        np.ones(10, dtype=np.uint8), commands, np.zeros((10, 6)), np.full((10, 12), np.nan),
        state.T, legs.T, motors.T))
    states = known.step(commands, steps=40)
    assert equal(state, known._state)
    assert equal(legs, known._of_legs)
    assert equal(motors, known._motors)
    assert np.abs(states.twist).max() > 1e-3


def test_parameters_are_checked_once_for_all() -> None:
    """A million values take no parameter set each."""
    p: Parameters = PLATFORM.parameters
    masses = rng(1).uniform(10.0, 400.0, 20_000)
    hexapods = Hexapods(p, len(masses), {'payload.mass': masses}, device='cpu')
    assert equal(hexapods._structures['mass'], p['platform.mass'] + masses)

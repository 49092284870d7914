# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Many hexapods at once, on a GPU or on the processors of a computer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, wraps
from typing import Any, Literal, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.core.binding import places, record
from stewart_dynamics.errors import (
    DeviceError, MotionError, one_line, ParameterError, PoseError, ReachError, StewartError)
from stewart_dynamics.gpu.device import count_devices, Device, device_of
from stewart_dynamics.gpu.given_arrays import leading, spread, take_array, take_mask
from stewart_dynamics.gpu.host import Host
from stewart_dynamics.gpu.own_structures import own_structures
from stewart_dynamics.gpu.uncertain_structures import uncertain_structures
from stewart_dynamics.mechanics.arguments import wrong_type
from stewart_dynamics.mechanics.batch import WIDTHS
from stewart_dynamics.mechanics.dynamics.result import InverseDynamics
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_euler, to_quaternion
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.limits import Limits
from stewart_dynamics.mechanics.rows import (
    BASE, CONDITION, MOTION, NO_BASE, POSE, WRENCH)
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.structure import LEG_FIELDS
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.simulator.end_stops import stop_limits, stops_of
from stewart_dynamics.simulator.plant import substeps
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters, TORQUE

_STATE = places('plant_state')
_PLANT = places('one_plant')
_FIRST = _PLANT['positions'].start
_POSITIONS, _RATES, _EFFORTS, _ACCELERATION, _LEVERS = (
    slice(_PLANT[name].start - _FIRST, _PLANT[name].stop - _FIRST)
    for name in ('positions', 'rates', 'efforts', 'acceleration', 'lever_ratios'))
_SOUND: int = _PLANT['sound'] - _FIRST
_LEGS = _SOUND + 1
UNREACHED = 'a leg does not reach, or a number is not finite'
_MOTORS = 18  # angles, speeds and torques of six


_Arguments = ParamSpec('_Arguments')
_Result = TypeVar('_Result')


def _in_memory(method: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Return a method that raises DeviceError where memory is too small, of a GPU as well."""
    @wraps(method)
    def checked(*arguments: _Arguments.args, **options: _Arguments.kwargs) -> _Result:
        try:
            return method(*arguments, **options)
        except MemoryError as exc:
            raise DeviceError(f'{method.__name__}: too little memory: {one_line(exc)}') from exc

    return checked


class HexapodStates(NamedTuple):
    """
    The simulated hexapods after a call: views of arrays that the next call changes.

    Arrays of the library that computes: numpy, or cupy on a GPU; N hexapods.
    """

    positions: Any  # of the drives (N, 6): lengths [m], angles [rad]
    rates: Any  # (N, 6) [m/s, rad/s]
    efforts: Any  # of the drives, without end stops (N, 6) [N, N m]
    position: Any  # of the platform (N, 3) [m]
    quaternion: Any  # x y z w (N, 4)
    twist: Any  # base axes (N, 6) [m/s, rad/s]
    acceleration: Any  # base axes (N, 6) [m/s^2, rad/s^2]
    motors: Any  # angles [rad], speeds [rad/s], torques [N m] (N, 18); not set without drive.*
    faulty: Any  # (N,) bool: held at rest until the next reset, see ``simulator.plant``


class Hexapods:
    """
    Many hexapods of one kind of legs, each with its own state, and parameters where wanted.

    All that they compute is the C source that the node runs: on a CPU with the bits of
    ``StewartPlatform`` and of ``stewart_simulator``, on a GPU in double precision with the same
    operations (docs/gpu.md says which results are equal to the bit).

    Arrays (N, ...) have a row for each hexapod, (S, N, ...) S samples of each; a row alone is for
    all. They may be of any library with DLPack, are float64 and stay where they are; results are
    arrays of numpy or, on a GPU, of cupy. Nothing waits for the GPU but where an error is raised.

    Parameters
    ----------
    platforms : StewartPlatform, Parameters, or a sequence of them
        Each of several stands for the same number of hexapods, one block after the other.
    count : int, optional
        Number of hexapods N, a multiple of the number of platforms; by default that number.
    parameters : mapping of names to arrays (N,) or (N, n), optional
        Values of single parameters for each hexapod: ``{'payload.mass': masses}``. End stops keep
        the springs and dampers of the platform.
    uncertainty : int, optional
        Seed by which hexapods are drawn that the file admits, by ``uncertainty.*``, in place of
        ``parameters``.
    device : str
        'cpu', 'cuda', 'cuda:1', ...; '': the first GPU if there is one, else the CPU.

    Attributes
    ----------
    count : int
        N.
    device : str
        'cpu' or 'cuda:N'.
    xp : module
        numpy or cupy.
    step_length : float
        Length of a step of ``step`` [s], short enough for friction and end stops.

    Raises
    ------
    ParameterError
        A value breaks a rule: names the hexapod; or the platforms have several kinds of legs.
    DeviceError
        No CuPy, driver or GPU; too little memory.

    """

    def __init__(self, platforms: StewartPlatform | Parameters | Sequence[Any],
                 count: int | None = None, parameters: Mapping[str, ArrayLike] | None = None, *,
                 uncertainty: int | None = None, device: str = '') -> None:
        several = list(platforms) if isinstance(platforms, list | tuple) else [platforms]
        self._parameters = [_parameters_of(each) for each in several]
        if not self._parameters:
            raise wrong_type('platforms', platforms, 'one or more')
        if len({each.leg_kind.number for each in self._parameters}) > 1:
            raise ParameterError('platforms: several kinds of legs: must be of one kind')
        number = len(several)
        self.count = number if count is None else count
        if not isinstance(self.count, int) or self.count < 1 or self.count % number:
            raise wrong_type('count', count, f'a positive multiple of {number} platforms')
        if uncertainty is not None and parameters:
            raise wrong_type('uncertainty', uncertainty, 'None where parameters are given')
        if uncertainty is not None and not (isinstance(uncertainty, int) and uncertainty >= 0):
            raise wrong_type('uncertainty', uncertainty, 'an integer of 0 or more')
        self._backend: Any = _backend_of(device)
        self.xp: Any = self._backend.xp
        self.device: str = self._backend.name
        self._own = {name: _on_host(name, value) for name, value in (parameters or {}).items()}
        try:
            blocks = np.repeat(np.arange(number), self.count // number)
            if uncertainty is not None:
                structures = np.concatenate([
                    uncertain_structures(each, self.count // number, uncertainty + n)
                    for n, each in enumerate(self._parameters)])
                blocks = np.arange(self.count)
            elif self._own:
                structures = np.concatenate([
                    own_structures(each, {name: value[blocks == n]
                                          for name, value in self._own.items()},
                                   self.count // number)
                    for n, each in enumerate(self._parameters)])
                blocks = np.arange(self.count)
            else:
                structures = np.stack([limited_structure(each) for each in self._parameters])
        except (MemoryError, IndexError) as exc:
            size = self.count * record('stewart_platform').itemsize / 2 ** 30
            raise (DeviceError(f'too little memory for the parameters of {self.count} hexapods, '
                               f'{size:.3g} GiB') if isinstance(exc, MemoryError) else
                   ParameterError(f'parameters: an array has fewer rows than {self.count} '
                                  'hexapods')) from exc
        self._structures: Any = structures
        self._platforms = self._backend.put(structures)
        self._which: Any = self.xp.asarray(blocks)
        self._kind = self._parameters[0].leg_kind
        self._state: Any = None
        self._no_wrench = self.xp.zeros((1, 1, WRENCH))
        self._no_base = self.xp.asarray(np.array([[NO_BASE]]))

    def __len__(self) -> int:
        """Return the number of hexapods."""
        return self.count

    def __repr__(self) -> str:
        """Return number, kind of legs and device."""
        return f'<Hexapods: {self.count} with {self._kind.name} legs on {self.device}>'

    def to_host(self, array: Any) -> Any:
        """Return an array as one of numpy; from a GPU it is copied."""
        return array if isinstance(array, np.ndarray) else self.xp.asnumpy(array)

    # ---- results of motions ---------------------------------------------------------------------

    @_in_memory
    def inverse_dynamics(self, motions: Any, wrench: Any = None, base: Any = None, *,
                         singular: Literal['raise', 'nan'] = 'raise', condition: bool = True,
                         ) -> InverseDynamics:
        """
        Return lengths, rates and forces of the legs, see ``StewartPlatform.inverse_dynamics``.

        Parameters
        ----------
        motions : (N, 24) or (S, N, 24)
            ``Motion.rows``: position, rotation row by row, twist, acceleration.
        wrench : (N, 6) or a row for all, optional
            External wrench on the platform [N, N m].
        base : (N, 12) or a row for all, optional
            ``BaseMotion.rows``.
        singular : 'raise' or 'nan'
            Where J_inv cannot be solved, a rod does not reach or numbers overflow: raise, which
            waits for the GPU, or let the numbers of the sample be nan.
        condition : bool
            Whether the condition number, half of the work, is computed; without it no sample
            counts as singular.

        """
        motion, load, moving, shape = self._loaded(motions, wrench, base)
        width = WIDTHS[self._kind.number]
        results = self._backend.empty((*motion.shape[:2], width))
        self._backend.solve(self._platforms, self._which, condition, width, motion, load, moving,
                            results)
        xp = self.xp
        unsolvable = results[..., CONDITION] >= UNSOLVABLE_CONDITION
        unsolvable |= ~xp.isfinite(results).all(axis=-1)
        if singular == 'nan':
            results[unsolvable] = xp.nan
        elif bool(unsolvable.any()):
            self._raise(unsolvable, shape, f'J_inv cannot be solved, {UNREACHED}')
        return InverseDynamics(self._joined(results, shape))

    @_in_memory
    def forward_dynamics(self, motions: Any, efforts: Any, wrench: Any = None, base: Any = None,
                         *, singular: Literal['raise', 'nan'] = 'raise') -> Any:
        """
        Return accelerations, linear and angular (..., 6), under efforts of the drives (..., 6).

        See ``StewartPlatform.forward_dynamics``; the accelerations in ``motions`` are ignored.
        Raises ReachError, or with singular='nan' they are nan, where a rod does not reach.
        """
        motion, load, moving, shape = self._loaded(motions, wrench, base)
        pushes, of_efforts = self._taken('efforts', efforts, 6)
        shape, samples = _common(shape, of_efforts)
        motion, load, moving, pushes = (
            self._again(name, array, samples) for name, array in (
                ('motions', motion), ('wrench', load), ('base', moving), ('efforts', pushes)))
        found = self._backend.empty((self.count, samples, 6))
        self._backend.launch('hexapods_accelerate', (self._platforms,), self._which, (samples,),
                             (motion, pushes, load, moving, found))
        return self._known(found, shape, singular, UNREACHED)

    @_in_memory
    def inverse_kinematics(self, poses: Any, *, singular: Literal['raise', 'nan'] = 'raise',
                           ) -> Any:
        """
        Return the positions of the drives (..., 6) in poses (..., 12): lengths [m], angles [rad].

        Poses are ``Pose.rows``, of motions the first 12 numbers. Raises ReachError, or with
        singular='nan' they are nan, where a rod does not reach.
        """
        rows, shape = self._taken('poses', poses, POSE.stop)
        found = self._backend.empty((self.count, rows.shape[1], 6))
        self._backend.launch('hexapods_positions', (self._platforms,), self._which,
                             (rows.shape[1],), (rows, found))
        return self._known(found, shape, singular, UNREACHED)

    @_in_memory
    def forward_kinematics(self, positions: Any, guesses: Any, *,
                           singular: Literal['raise', 'nan'] = 'raise') -> Any:
        """
        Return poses (..., 12) of positions of the drives (..., 6), from guesses (..., 12).

        See ``StewartPlatform.forward_kinematics``. Raises PoseError, or with singular='nan' they
        are nan, where it did not converge.
        """
        wanted, shape = self._taken('positions', positions, 6)
        rows, of_guesses = self._taken('guesses', guesses, POSE.stop)
        shape, samples = _common(shape, of_guesses)
        wanted, rows = (self._again(name, array, samples) for name, array in (
            ('positions', wanted), ('guesses', rows)))
        found = self._backend.empty((self.count, samples, POSE.stop))
        found[...] = rows
        codes = self.xp.empty((self.count, samples), dtype=np.int64)
        self._backend.launch('hexapods_poses', (self._platforms,), self._which, (samples,),
                             (wanted, found, codes))
        found[codes != 0] = self.xp.nan
        return self._known(found, shape, singular, 'did not converge from the guess', PoseError)

    @_in_memory
    def limits(self, motions: Any, wrench: Any = None, base: Any = None) -> Any:
        """
        Return which limits each leg exceeds (..., 6), int64: bits ``STEWART_...`` in C.

        Limits of poses, twists, loads and motors, without those that depend on earlier motions.
        -1: numbers overflow, or a leg does not reach.
        """
        motion, load, moving, shape = self._loaded(motions, wrench, base)
        found = self.xp.empty((*motion.shape[:2], 6), dtype=np.int64)
        self._backend.launch('hexapods_limits', (self._platforms,), self._which,
                             (motion.shape[1],), (motion, load, moving, found))
        return self._joined(found, shape)

    # ---- simulation -----------------------------------------------------------------------------

    @cached_property
    def step_length(self) -> float:
        """Return the length of a step [s], the same for all hexapods."""
        return min(1.0 / each.rate / (round(1.0 / each.rate / each.step) * substeps(each))
                   for each in (*self._simulated, *self._extremes()))

    @cached_property
    def _simulated(self) -> list[SimulatorParameters]:
        return [_simulator_parameters(each) for each in self._parameters]

    def _extremes(self) -> list[SimulatorParameters]:
        """Return hexapods with the smallest or the largest value of a parameter of their own."""
        found, block = [], self.count // len(self._parameters)
        for value in self._own.values():
            rows = np.asarray(value).reshape(self.count, -1)
            for at in {int(at) for of in (rows.min(axis=1), rows.max(axis=1))
                       for at in (of.argmin(), of.argmax())}:
                found.append(self._simulated[at // block].replaced({
                    name: np.asarray(of)[at] for name, of in self._own.items()}))
        return found

    @cached_property
    def _constants(self) -> Any:
        """Return the rows of ``plant_constants``, as many as structures."""
        rows: Any = np.zeros(len(self._parameters), record('plant_constants'))
        for row, each in zip(rows, self._simulated, strict=True):
            row['by_torques'] = each.commands == TORQUE
            row['stops'], row['effort_max'] = stops_of(each), Limits(each).force_max
        rows = rows[np.arange(len(self._structures)) * len(rows) // len(self._structures)]
        names = {name: field for field, name in LEG_FIELDS.items()}
        low, high, least = stop_limits(self._simulated[0])
        for name, of in ((low, rows['stops']['lowest']), (high, rows['stops']['highest']),
                         (least, rows['stops']['least_lever']),
                         (self._kind.effort_limit, rows['effort_max'])):
            if name in self._own:
                of[...] = self._structures['legs'][names[name]]
        return self._backend.put(rows)

    @property
    def commands(self) -> str:
        """Return the quantity that ``step`` takes: the parameter ``commands`` of the simulator."""
        return self._simulated[0].commands

    @property
    def states(self) -> HexapodStates:
        """Return the simulated hexapods as they are; first, at rest in their initial poses."""
        if self._state is None:
            self.reset()
        state, legs = self._state, self._of_legs
        return HexapodStates(
            legs[:, _POSITIONS], legs[:, _RATES], legs[:, _EFFORTS], state[:, _STATE['position']],
            state[:, _STATE['quaternion']], state[:, _STATE['twist']], legs[:, _ACCELERATION],
            self._motors, legs[:, _SOUND] == 0.0)

    @_in_memory
    def reset(self, mask: Any = None, poses: Any = None) -> HexapodStates:
        """
        Put hexapods at rest, and return all states.

        Parameters
        ----------
        mask : (N,) bool, optional
            Which; by default all.
        poses : (N, 12), or a row for all, optional
            Where; by default ``initial_pose`` of the simulator, else the home pose.

        Raises
        ------
        ReachError
            A rod does not reach in a pose that is given; names the hexapod.

        """
        xp = self.xp
        if self._state is None:
            self._state, self._of_legs, self._motors = (
                self._backend.empty((self.count, size)) for size in (
                    len(self._initial[0]), _LEGS, _MOTORS))
            self._state[...], self._of_legs[...] = self._initial, 0.0
            self._motors[...] = 0.0
            chosen = xp.ones(self.count, dtype=bool)
            if mask is not None:
                self.reset()
        if mask is not None:
            chosen = take_mask(xp, 'mask', mask, self.count, self.device)
        else:
            chosen = xp.ones(self.count, dtype=bool)
        rows = self._initial
        if poses is not None:
            given = take_array(xp, 'poses', poses, (POSE.stop,), self.device)
            flat = spread(xp, 'poses', given, self.count, 1, POSE.stop)[:, 0]
            rows = xp.concatenate([flat[:, :3], _quaternions(xp, flat[:, 3:]),
                                   xp.zeros((self.count, 6))], axis=1)
        self._state[...] = xp.where(chosen[:, None], rows, self._state)
        self._of_legs[:, _SOUND] = xp.where(chosen, 1.0, self._of_legs[:, _SOUND])
        self._advance(0, xp.zeros((1, 6)), self._no_wrench[0], self._no_base[0], chosen)
        self._of_legs[:, _ACCELERATION] = xp.where(
            chosen[:, None], 0.0, self._of_legs[:, _ACCELERATION])
        if poses is not None:
            wrong = chosen & ~xp.isfinite(self._of_legs[:, _POSITIONS]).all(axis=-1)
            if bool(wrong.any()):
                at = int(xp.flatnonzero(wrong)[0])
                raise ReachError(f'poses: hexapod {at}: a leg does not reach, or is not finite')
        return self.states

    @_in_memory
    def step(self, commands: Any, wrench: Any = None, base: Any = None, steps: int = 1,
             ) -> HexapodStates:
        """
        Integrate the motion over a number of steps, and return the states.

        The method, the end stops and the limits of efforts are those of ``stewart_simulator``
        (``simulator.plant``). A hexapod whose motion cannot be computed is ``faulty``: it is held
        at rest until it is reset.

        Parameters
        ----------
        commands : (N, 6), or a row for all
            Efforts of the drives or torques of the motors, ``self.commands``, constant in the
            call.
        wrench : (N, 6), or a row for all, optional
            On the platform at its origin, base axes [N, N m].
        base : (N, 12), or a row for all, optional
            Motion of the base, ``BaseMotion.rows``.
        steps : int
            Number of steps of ``step_length``.

        """
        if not isinstance(steps, int) or steps < 0:
            raise wrong_type('steps', steps, 'an integer of 0 or more')
        if self._state is None:
            self.reset()
        rows = [self._row('commands', commands, 6),
                self._no_wrench[0] if wrench is None else self._row('wrench', wrench, WRENCH),
                self._no_base[0] if base is None else self._row('base', base, BASE)]
        self._advance(steps, rows[0], rows[1], rows[2], self.xp.ones(self.count, dtype=bool))
        return self.states

    def _advance(self, steps: int, commands: Any, wrench: Any, base: Any, chosen: Any) -> None:
        self._backend.launch(
            'hexapods_step', (self._platforms, self._constants), self._which,
            (float(steps), self.step_length),
            (commands, wrench, base, self._state, self._of_legs, self._motors), chosen)

    @cached_property
    def _initial(self) -> Any:
        """Return the states (N, 13) at rest in the initial poses."""
        rows = np.zeros((len(self._parameters), 13))
        for row, each in zip(rows, self._simulated, strict=True):
            row[_STATE['position']] = each.initial_pose[:3]
            row[_STATE['quaternion']] = to_quaternion(from_euler(each.initial_pose[3:]))
        return self.xp.asarray(np.repeat(rows, self.count // len(rows), axis=0))

    # ---- arguments ------------------------------------------------------------------------------

    def _taken(self, name: str, value: Any, width: int) -> tuple[Any, tuple[int, ...]]:
        """Return an argument (N, S, width), and its shape of samples."""
        array = take_array(self.xp, name, value, (width,), self.device)
        shape = leading(name, array, self.count)
        return spread(self.xp, name, array, self.count, shape[0] if shape else 1, width), shape

    def _again(self, name: str, array: Any, samples: int) -> Any:
        """Return an array (N, 1, width) or (N, S, width) with this number of samples."""
        if array.shape[1] not in (1, samples):
            raise MotionError(f'{name}: {array.shape[1]} samples: must be 1 or {samples}')
        return self.xp.broadcast_to(array, (self.count, samples, array.shape[2]))

    def _row(self, name: str, value: Any, width: int) -> Any:
        """Return an argument (N, width) of one sample for each hexapod."""
        rows, shape = self._taken(name, value, width)
        if shape:
            raise MotionError(f'{name}: {shape[0]} samples of each hexapod: must be one')
        return rows[:, 0]

    def _loaded(self, motions: Any, wrench: Any, base: Any,
                ) -> tuple[Any, Any, Any, tuple[int, ...]]:
        """Return motions, wrenches and bases (N, S, ...), and the shape of samples."""
        rows, shape = self._taken('motions', motions, MOTION)
        load, of_load = ((self._no_wrench, ()) if wrench is None
                         else self._taken('wrench', wrench, WRENCH))
        moving, of_base = ((self._no_base, ()) if base is None
                           else self._taken('base', base, BASE))
        shape, samples = _common(shape, of_load, of_base)
        return (self._again('motions', rows, samples), self._again('wrench', load, samples),
                self._again('base', moving, samples), shape)

    def _joined(self, rows: Any, shape: tuple[int, ...]) -> Any:
        """Return results (N, S, width) as (N, width) or (S, N, width)."""
        return rows.transpose(1, 0, 2) if shape else rows[:, 0]

    def _known(self, found: Any, shape: tuple[int, ...], singular: str, words: str,
               kind: type[StewartError] = ReachError) -> Any:
        """Return results (N, S, width) as (N, width) or (S, N, width), all of them finite."""
        if singular == 'raise':
            wrong = ~self.xp.isfinite(found).all(axis=-1)
            if bool(wrong.any()):
                self._raise(wrong, shape, words, kind)
        return self._joined(found, shape)

    def _raise(self, wrong: Any, shape: tuple[int, ...], words: str,
               kind: type[StewartError] = ReachError) -> None:
        hexapod, sample = (int(each[0]) for each in self.xp.nonzero(wrong))
        of_sample = f', sample {sample}' if shape else ''
        raise kind(f'hexapod {hexapod}{of_sample}: {words}')


def _common(*shapes: tuple[int, ...]) -> tuple[tuple[int, ...], int]:
    """Return the shape of samples to which these broadcast, and the number of samples."""
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError as exc:
        raise MotionError(f'samples do not fit each other: {shapes}') from exc
    return shape, shape[0] if shape else 1


def _on_host(name: str, values: Any) -> Any:
    """Return values of a parameter as an array of numpy, where they are checked."""
    try:
        return np.asarray(values.get() if hasattr(values, '__cuda_array_interface__') and hasattr(
            values, 'get') else values)
    except (TypeError, ValueError, RuntimeError) as exc:
        raise ParameterError(f'parameters: {name}: not an array in the memory of the host: '
                             f'{one_line(exc)}') from exc


def _parameters_of(platform: Any) -> Parameters:
    parameters = platform.parameters if isinstance(platform, StewartPlatform) else platform
    if not isinstance(parameters, Parameters):
        raise wrong_type('platforms', platform, 'StewartPlatform or Parameters')
    return parameters


def _simulator_parameters(parameters: Parameters) -> SimulatorParameters:
    """Return the parameters of the simulated hexapod; without them, it begins at home."""
    if isinstance(parameters, SimulatorParameters):
        return parameters
    home = StewartPlatform(parameters).home_pose()
    return SimulatorParameters({
        **parameters.given, 'initial_pose': [*home.position, *to_euler(home.rotation)]},
        parameters.source)


def _backend_of(device: str) -> Host | Device:
    if device == '':
        try:
            return Device(0) if count_devices() else Host()
        except DeviceError:
            return Host()
    kind, number = device_of(device)
    return Host() if kind == 'cpu' else Device(number)


def _quaternions(xp: Any, rotations: Any) -> Any:
    """Return the quaternions x y z w (N, 4) of rotations (N, 9), row by row."""
    r = rotations.reshape(-1, 3, 3)
    trace = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    # The four numbers, times one of them: by that which is largest nothing is lost.
    products = xp.empty((len(r), 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[:, i, i] = 1.0 + 2.0 * r[:, i, i] - trace
        products[:, i, j] = products[:, j, i] = r[:, i, j] + r[:, j, i]
        products[:, i, 3] = products[:, 3, i] = r[:, k, j] - r[:, j, k]
    products[:, 3, 3] = 1.0 + trace
    each = xp.arange(4)
    largest = products[:, each, each].argmax(axis=1)
    found = products[xp.arange(len(r)), largest]
    return found / xp.sqrt((found ** 2).sum(axis=1, keepdims=True))

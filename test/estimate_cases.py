# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Recordings that judge the estimates of identification and payload.

True hexapods are drawn from ``uncertainty.*`` of the parameter file, their motions and efforts are
those of ``independent_hexapod`` and ``independent_cranks``, and sensors add noise, quantization,
jitter and delay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from independent_cranks import CrankBodies, cranks
from independent_hexapod import Controlled, Legs, moving
import numpy as np
from numpy.typing import NDArray
from recorded import AMPLITUDES, Noise, Recorded
from referees import rng, ROOT, rotation_about
from scipy.signal import lfilter

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.errors import StewartError
from stewart_dynamics.external_wrench.estimate import Estimate
from stewart_dynamics.external_wrench.measured_legs import LegHistory
from stewart_dynamics.external_wrench.payload import identify, rows_of
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_results import document
from stewart_dynamics.identification.identify import Identification
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.rows import NO_BASE

Array = NDArray[np.float64]
LegsAt = Callable[[Array], Legs]
MotionAt = Callable[[Array], Motion]

GIVEN = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
RATE, SECONDS = 250.0, 20.0
HOME = np.array([0.0, 0.0, 1.1, 0.0, 0.0, 0.0])
AXES = ('surge', 'sway', 'heave', 'roll', 'pitch', 'yaw')
TILTS = 1.0, 2.0, 2.8  # [degrees]
SLOW = 8e-3  # largest rate of a leg in a slow motion [m/s]


# --- hexapods ------------------------------------------------------------------------------------

class Case(NamedTuple):
    """A parameter file of a kind of legs, its true legs, and the sizes of motions and noise."""

    given: Parameters
    moving: Callable[[Parameters, Motion], Any]
    center: Array  # of the motions: x y z and Euler angles
    size: float = 1.0  # of the motions
    reach: float = 1.0  # movement of a joint by that of its drive

    def placed(self, path: Sines) -> Sines:
        """Return a motion of the telescopic hexapod as one of this hexapod."""
        return path._replace(sines=self.size * path.sines,
                             center=path.center + (self.center - HOME))

    def noise(self, sensors: Noise) -> Noise:
        """Return sensors that are as good as these of the telescopic hexapod."""
        return sensors._replace(
            length=sensors.length / self.reach, rate=sensors.rate / self.reach,
            effort=sensors.effort * self.reach, coloured=sensors.coloured * self.reach)


def moving_cranks(p: Parameters, motion: Motion) -> Legs:
    """Return angles [rad], speeds [rad/s] and torques [N m] of the cranks of a hexapod."""
    found = cranks(p, motion)
    return Legs(found.angles, found.speeds, found.torques)


CRANKS = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
CASES = {
    'telescopic': Case(GIVEN, moving, HOME),
    'crank': Case(CRANKS, moving_cranks, np.array([0.0, 0.0, 0.648, 0.0, 0.0, 0.0]),
                  1.0, float(CRANKS['legs.crank.length'][0]))}


class Truth(NamedTuple):
    """A true hexapod, its gravity as the base frame has it, and the gain of its efforts."""

    parameters: Parameters
    tilt: tuple[float, float] = (0.0, 0.0)
    """Angles of gravity about x, then y [rad]; the parameters have it."""
    gain: float = 1.0

    @property
    def case(self) -> Case:
        """Return the case of its kind of legs."""
        return CASES[self.parameters.leg_kind.name]

    def changed(self, **changes: Any) -> Truth:
        """Return a truth with other parameters; ``__`` in a name for a point."""
        return self._replace(parameters=self.parameters.replaced(
            {name.replace('__', '.'): value for name, value in changes.items()}))

    def values(self) -> dict[str, float]:
        """Return the values by the names of identification.json."""
        p, (mass, center, inertia) = self.parameters, (
            self.parameters[f'platform.{name}'] for name in (
                'mass', 'center_of_mass', 'inertia'))
        found = {'platform.mass': mass}
        found |= {f'platform.center_of_mass.{axis}': each for axis, each in zip(
            'xyz', center, strict=True)}
        found |= {f'platform.inertia.{axes}': each for axes, each in zip(
            ('xx', 'xy', 'xz', 'yy', 'yz', 'zz'), inertia, strict=True)}
        found |= {'gravity.tilt_x': self.tilt[0], 'gravity.tilt_y': self.tilt[1]}
        for leg, joint in enumerate(p['joints']):
            found |= {f'actuator.{name}.{joint}': p[f'actuator.{name}'][leg] for name in (
                'viscous_friction', 'coulomb_friction')}
        return found | (_of_cranks(p) if 'legs.crank.length' in p.given else _of_pistons(p))


def _of_pistons(p: Parameters) -> dict[str, float]:
    """Return the values of telescopic legs."""
    found = {}
    for leg, joint in enumerate(p['joints']):
        found[f'actuator.reflected_mass.{joint}'] = p['actuator.reflected_mass'][leg]
        for part in ('cylinder', 'piston'):
            m, s, i = (p[f'legs.{part}.{name}'][leg] for name in (
                'mass', 'center_of_mass', 'inertia'))
            found |= {f'legs.{part}.mass.{joint}': m,
                      f'legs.{part}.first_moment.{joint}': m * s,
                      f'legs.{part}.second_moment.{joint}': i + m * s * s}
    return found


def _of_cranks(p: Parameters) -> dict[str, float]:
    """Return the values of cranks and rods, and the sums of them that torques show."""
    found = {}
    bodies, rotors = CrankBodies.of(p), p['actuator.reflected_inertia']
    for leg, joint in enumerate(p['joints']):
        mass, size = p['legs.crank.mass'][leg], p['legs.crank.length'][leg]
        x, y, _ = bodies.centers[leg]
        about = bodies.inertias[leg, 2, 2] + mass * (x ** 2 + y ** 2)
        rod, length = p['legs.rod.mass'][leg], p['legs.rod.length'][leg]
        part, turning = bodies.rod_centers[leg] / length, bodies.rod_inertias[leg] / length ** 2
        end = rod * (1.0 - part) ** 2 + turning
        of_leg = {
            'actuator.reflected_inertia': rotors[leg], 'legs.crank.first_moment.e': mass * x,
            'legs.crank.first_moment.n': mass * y, 'legs.crank.inertia_about_axis.uu': about,
            'legs.rod.crank_end_mass': end,
            'legs.rod.coupling_mass': rod * part * (1.0 - part) - turning,
            'legs.rod.platform_end_mass': rod * part ** 2 + turning,
            'legs.crank.shaft_inertia': about + rotors[leg] + end * size ** 2,
            'legs.crank.shaft_moment.e': mass * x + end * size,
            'legs.crank.shaft_moment.n': mass * y}
        found |= {f'{name}.{joint}': float(value) for name, value in of_leg.items()}
    return found


FILE = Truth(GIVEN)
PLATFORM = list(FILE.values())[:10]  # names of mass, center of mass and inertia


def prior(name: str, given: Parameters = GIVEN) -> float:
    """Return the standard deviation by which a file knows a value; of friction, its own size."""
    kind, value = name.split('.')[1], Truth(given).values()[name]
    if kind == 'inertia':
        value = np.mean(given['platform.inertia'][[0, 3, 5]])
    known = {'mass': 'platform_mass', 'inertia': 'inertia', 'reflected_mass': 'reflected_mass',
             'reflected_inertia': 'reflected_mass'}
    if kind == 'center_of_mass':
        return float(given['uncertainty.center_of_mass'])
    if kind.startswith('tilt'):
        return float(given['uncertainty.tilt'])
    return float(value * (given[f'uncertainty.{known[kind]}'] if kind in known else 1.0))


def drawn(seed: int, given: Parameters = GIVEN) -> Truth:
    """Return a hexapod drawn from the uncertainty of the file, with any friction."""
    random, p = rng(seed), given
    kind = p.leg_kind
    reflected = kind.fields['reflected_mass']

    def relative(name: str, size: int | tuple[int, ...] = ()) -> Any:
        return 1.0 + p[f'uncertainty.{name}'] * np.clip(random.normal(size=size), -3.0, 3.0)

    mass = 0.0
    while not mass > 0.05 * p['platform.mass']:
        mass = p['platform.mass'] * relative('platform_mass')
    changes = {
        'platform.mass': mass,
        'platform.center_of_mass': p['platform.center_of_mass'] + p[
            'uncertainty.center_of_mass'] * random.normal(size=3),
        'platform.inertia': _inertia(random, given),
        reflected: p[reflected] * relative('reflected_mass', 6),
        **{f'actuator.{kind}_friction': p[f'actuator.{kind}_friction'] * random.uniform(
            0.3, 2.0, 6) for kind in ('viscous', 'coulomb')}}
    of_rods = CrankBodies.of(p) if kind.name == 'crank' else None
    for part in kind.bodies:
        for name in ('mass', 'center_of_mass', 'inertia'):
            value = p[f'legs.{part}.{name}']
            if value is None and of_rods is not None:
                value = of_rods.rod_centers if name == 'center_of_mass' else of_rods.rod_inertias
            value = value * (relative('leg_mass') + relative('leg_mass', 6) - 1.0)
            if (part, name) == ('crank', 'inertia'):  # of six numbers, about the axis alone
                value = np.outer(value, np.arange(6) == 5)
            changes[f'legs.{part}.{name}'] = value
    tilt = p['uncertainty.tilt'] * random.normal(size=2)
    changes['gravity'] = tilted(p['gravity'], *tilt)
    return Truth(p.replaced(changes), tuple(tilt), float(relative('effort_gain')))


def with_friction(seed: int) -> Truth:
    """Return the hexapod of the file with the friction of a drawn one."""
    p = drawn(seed).parameters
    return FILE.changed(**{f'actuator__{kind}_friction': p[f'actuator.{kind}_friction']
                           for kind in ('viscous', 'coulomb')})


def tilted(gravity: Array, about_x: float, about_y: float) -> Array:
    """Return gravity turned about x, then about y [rad]."""
    x, y, _ = np.eye(3)
    turned: Array = rotation_about(y, about_y) @ rotation_about(x, about_x) @ gravity
    return turned


def _inertia(random: np.random.Generator, p: Parameters) -> Array:
    """Return an inertia about the file's that a real body has."""
    given = p['platform.inertia']
    scale = p['uncertainty.inertia'] * np.mean(given[[0, 3, 5]])
    change = scale * random.normal(size=6)
    while True:
        xx, xy, xz, yy, yz, zz = found = given + change
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if moments[0] > 0.0 and moments[0] + moments[1] > 1.02 * moments[2]:
            return np.asarray(found)
        change = 0.8 * change


# --- motions -------------------------------------------------------------------------------------

Warp = Callable[[Array], tuple[Array, Array, Array]]
START = 1.5  # [s]


def ramp(times: Array, begin: float, seconds: float = START) -> tuple[Array, Array, Array]:
    """Return the integral of a smooth step from 0 to 1, the step, and its rate."""
    u = np.clip((times - begin) / seconds, 0.0, 1.0)
    return (seconds * (u ** 6 - 3.0 * u ** 5 + 2.5 * u ** 4) + np.maximum(
        times - begin - seconds, 0.0), 10 * u ** 3 - 15 * u ** 4 + 6 * u ** 5,
        30.0 * (u * (1.0 - u)) ** 2 / seconds)


def started(times: Array) -> tuple[Array, Array, Array]:
    """Return a time that begins to run smoothly at 0, with its derivatives."""
    return ramp(times, 0.0)


def stopping(begin: float, end: float = np.inf) -> Warp:
    """Return a time that stands from ``begin`` to ``end`` [s], and before it if that is 0."""
    if begin <= 0.0:
        return lambda times: ramp(times, end)

    def at(times: Array) -> tuple[Array, Array, Array]:
        parts = [ramp(times, 0.0), ramp(times, begin - START),
                 ramp(times, end if np.isfinite(end) else 1e6)]
        return tuple(a - b + c for a, b, c in zip(*parts, strict=True))  # type: ignore

    return at


def chirp(first: float, last: float, seconds: float) -> Warp:
    """Return a time by which a motion of 1 Hz sweeps from one frequency to another [Hz]."""
    slope = (last - first) / seconds
    return lambda t: (first * t + 0.5 * slope * t ** 2, first + slope * t, slope + 0.0 * t)


class Sines(NamedTuple):
    """Sums of sines about a pose: x y z and Euler angles."""

    sines: Array  # (2, harmonics, 6)
    frequencies: Array  # (harmonics,) [Hz]
    warp: Warp = started
    center: Array = HOME

    def __call__(self, times: Array) -> Motion:
        """Return the motion at times [s]."""
        s, rate, change = self.warp(np.asarray(times))
        w = 2.0 * np.pi * self.frequencies
        phase = s[:, None] * w
        sine, cosine = np.sin(phase), np.cos(phase)
        a, b = self.sines
        x = self.center + sine @ a + cosine @ b
        first = (cosine * w) @ a - (sine * w) @ b
        second = -(sine * w ** 2) @ a - (cosine * w ** 2) @ b
        v = first * rate[:, None]
        acc = second * rate[:, None] ** 2 + first * change[:, None]
        return Motion.from_euler(x[:, :3], x[:, 3:], v[:, :3], v[:, 3:], acc[:, :3], acc[:, 3:])


def rich(random: np.random.Generator, size: float = 0.45) -> Sines:
    """Return a motion of all coordinates."""
    sines = random.normal(size=(2, 12, 6))
    sines *= size * AMPLITUDES / np.sqrt(np.sum(sines ** 2, axis=(0, 1)))
    return Sines(sines, 0.1 * np.arange(1, 13))


def one_axis(axis: str, random: np.random.Generator) -> Sines:
    """Return a motion of one coordinate."""
    sines = random.normal(size=(2, 3, 6)) * (np.arange(6) == AXES.index(axis))
    sines *= 0.7 * AMPLITUDES / np.maximum(np.sqrt(np.sum(sines ** 2, axis=(0, 1))), 1e-300)
    return Sines(sines, np.array([0.3, 0.5, 0.8]))


def slow(random: np.random.Generator, base: float = 0.1) -> Sines:
    """Return a motion in which no leg is faster than SLOW, of harmonics of a frequency [Hz]."""
    path = rich(random, 0.05)._replace(frequencies=base * np.arange(1, 13))
    fastest = np.abs(moving(GIVEN, path(np.arange(0.0, SECONDS, 0.01))).rates).max()
    return path._replace(sines=path.sines * SLOW / fastest)


def at_rest(degrees: float, random: np.random.Generator) -> Sines:
    """Return a pose at rest, tilted about any horizontal axis."""
    return about_tilted(degrees, random, Sines(np.zeros((2, 1, 6)), np.ones(1)))


def about_tilted(degrees: float, random: np.random.Generator, path: Sines) -> Sines:
    """Return a motion about a tilted pose."""
    turn = random.uniform(0.0, 2.0 * np.pi)
    return path._replace(center=HOME + np.radians(degrees) * np.array(
        [0.0, 0.0, 0.0, np.cos(turn), np.sin(turn), 0.0]))


def sweep(random: np.random.Generator) -> Sines:
    """Return a sweep of one coordinate from 0.1 to 2 Hz."""
    path = one_axis(AXES[random.integers(6)], random)
    return Sines(0.4 * path.sines[:, :1], np.ones(1), chirp(0.1, 2.0, SECONDS))


def gentle_then_rest(random: np.random.Generator) -> Sines:
    """Return a motion of half of the time, and rest."""
    return rich(random, 0.2)._replace(warp=stopping(0.5 * SECONDS))


MOTIONS: dict[str, Callable[[np.random.Generator], Sines]] = {
    'rich': rich,
    **{axis: lambda random, axis=axis: one_axis(axis, random) for axis in AXES},
    'sweep': sweep, 'slow': slow, 'creeping': lambda random: slow(random, 0.004),
    **{f'at rest, tilted by {each:g} deg': lambda random, each=each: at_rest(each, random)
       for each in TILTS},
    'heave about 2.8 deg': lambda random: about_tilted(2.8, random, one_axis('heave', random)),
    'gentle, then rest': gentle_then_rest,
    'yaw in closed loop': lambda random: one_axis('yaw', random), 'rich in closed loop': rich}
CLOSED_LOOP = 'closed loop'


def legs_of(truth: Truth, motion: str, seed: int, seconds: float = SECONDS) -> LegsAt:
    """Return the legs of a hexapod in a motion of MOTIONS."""
    path = truth.case.placed(MOTIONS[motion](rng(7000 + seed)))
    if CLOSED_LOOP not in motion:
        return lambda times: truth.case.moving(truth.parameters, path(times))
    times = np.arange(0.0, seconds + 0.1, Controlled.PERIOD)
    return Controlled(truth.parameters, path(times))


# --- sensors -------------------------------------------------------------------------------------

SENSORS = Noise(length=5e-6, rate=5e-4, effort=2.5)
EXACT = Noise(0.0, 0.0, 0.0, 0.0, 0.0)
QUANTIZED = SENSORS._replace(steps=(1e-6, 1e-3, 5.0))


def recording(legs: LegsAt, seed: int, sensors: Noise = SENSORS, gain: float = 1.0,
              seconds: float = SECONDS, rate: float = RATE, given: Parameters = GIVEN) -> Recorded:
    """Return a recording of some legs; ``legs`` begin at 0 s."""
    random = rng(9000 + seed)
    stamps = np.arange(round(seconds * rate)) / rate
    taken = stamps + sensors.jitter * random.normal(size=len(stamps))
    there, pushed = legs(np.maximum(taken, 0.0)), legs(np.maximum(taken - sensors.delay, 0.0))
    memory = np.exp(-1.0 / (0.05 * rate))
    noise = random.normal(size=(4, len(stamps), 6))
    drive = np.sqrt(1.0 - memory ** 2) * noise[3]
    drive[0] = noise[3, 0]
    values = (there.lengths - given['geometry.zero_length'] + sensors.length * noise[0],
              there.rates + sensors.rate * noise[1],
              gain * pushed.forces + sensors.effort * noise[2]
              + sensors.coloured * lfilter([1.0], [1.0, -memory], drive, axis=0))
    return sensors.recorded(stamps, *values)


def recorded(truth: Truth, motion: str, seed: int, sensors: Noise = SENSORS,
             seconds: float = SECONDS, rate: float = RATE) -> Recorded:
    """Return a recording of a hexapod in a motion of MOTIONS."""
    case = truth.case
    return recording(legs_of(truth, motion, seed, seconds), seed, case.noise(sensors), truth.gain,
                     seconds, rate, case.given)


def braked(legs: LegsAt, begin: float, end: float) -> LegsAt:
    """Return legs that brakes hold for some time, so that the drives need no force."""
    def at(times: Array) -> Legs:
        found = legs(times)
        held = (times >= begin) & (times < end)
        return found._replace(forces=np.where(held[:, None], 0.0, found.forces))

    return at


# --- estimates -----------------------------------------------------------------------------------

class Judged(NamedTuple):
    """An estimate and the true value."""

    name: str
    value: float
    half: float
    """Half of the 95 % interval; nan: none."""
    identified: bool
    truth: float
    prior: float
    """Standard deviation by which the file knows the value."""

    @property
    def holds(self) -> bool:
        """Return whether the interval contains the true value."""
        return self.miss <= 1.0

    @property
    def miss(self) -> float:
        """Return the error divided by half of the interval."""
        return abs(self.value - self.truth) / self.half if self.half else np.inf


class Outcome(NamedTuple):
    """The answer to some recordings."""

    judged: tuple[Judged, ...] = ()
    causes: tuple[str, ...] = ()
    """Keywords of possible errors and of the likely cause of a lack of fit, likeliest first."""
    notices: tuple[str, ...] = ()
    """Their texts, and notices on the bags."""
    delay: float = np.nan

    @property
    def intervals(self) -> list[Judged]:
        """Return the estimates that have an interval."""
        return [each for each in self.judged if not np.isnan(each.half)]

    def of(self, name: str) -> Judged:
        """Return an estimate."""
        return next(each for each in self.judged if each.name == name)


def identified(bags: Sequence[Recorded], truth: Truth, given: Parameters | None = None,
               rate: float = RATE, **options: Any) -> Outcome:
    """Return the outcome of stewart_identify without bag files."""
    chosen = IdentificationOptions(**options)
    try:
        with closing(Identification(given or truth.case.given, chosen)) as work:
            for n, each in enumerate(bags):
                work.add(Path(f'bag {n}'), [Window(
                    0, 1.0 / rate, each.positions, each.rates, each.efforts,
                    np.zeros(each.efforts.shape, dtype=bool))])
            result = document(work.result(), chosen)
    except StewartError as exc:
        return Outcome((), ('rejected',), (str(exc),))
    found = [(each.what, each.text) for each in result.likely_mistakes]
    if lack := result.lack_of_fit:
        found.append((lack.cause, lack.text))
    of_bags = [text for bag in result.bags for text in bag.notices]
    values = truth.values()
    return Outcome(
        tuple(Judged(each.name, each.value, np.diff(each.interval)[0] / 2.0 if each.interval
                     else np.nan, each.state == 'identified', values[each.name],
                     each.file_deviation)
              for each in (*result.parameters, *(result.base_parameters or ()))),
        tuple(what for what, _ in found), (*(text for _, text in found), *of_bags),
        result.bags[0].delay_s or np.nan)


def history_of(given: Recorded, motion: Motion, p: Parameters = GIVEN) -> LegHistory:
    """Return the recording as the node keeps it; poses near those of a motion."""
    platform = StewartPlatform(p)  # for the geometry
    poses = platform.forward_kinematics(given.positions + p['geometry.zero_length'], motion)
    rows = np.hstack([poses.position, poses.rotation.reshape(-1, 9),
                      platform.twist(poses, given.rates)])
    history = LegHistory(p['payload.window'])
    for time, row, forces in zip(given.times, rows.tolist(), given.efforts.tolist(), strict=True):
        history.add_measurement(tuple(forces), Estimate(
            round((2.0 + time) * 1e9), tuple(row), None, None, NO_BASE), NO_WRENCH)
    return history


PAYLOAD_RATE, PAYLOAD_SECONDS = 500.0, 10.0
PAYLOAD_SENSORS = SENSORS._replace(rate=1e-3, effort=5.0, delay=0.5 / PAYLOAD_RATE)


def payload(truth: Truth, motion: str, seed: int, sensors: Noise = PAYLOAD_SENSORS,
            given: Parameters | None = None) -> Outcome:
    """Return the outcome of the payload service."""
    case = truth.case
    given = given or case.given
    legs = recorded(truth, motion, seed, sensors, PAYLOAD_SECONDS, PAYLOAD_RATE)
    near = case.placed(MOTIONS[motion](rng(7000 + seed)))(legs.times)
    *_, outcome = identify(history_of(legs, near, case.given), StewartPlatform(given))
    assert outcome is not None
    if outcome.payload is None:
        return Outcome((), ('rejected',), (outcome.message,))
    fitted = outcome.payload.fitted
    return Outcome(tuple(
        Judged(name, value, half if known else np.nan, known, truth.values()[name],
               prior(name, given))
        for name, (_, _, value, half, known) in zip(PLATFORM, rows_of(fitted), strict=True)),
        ('effort_gain',) if fitted.gain else ())

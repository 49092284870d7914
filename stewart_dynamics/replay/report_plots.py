# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The plots of a report over time and frequency: channels, titles, notes and bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.colors import AXIS_COLORS, LEG_COLORS, ROLES
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES, sources_of
from stewart_dynamics.mechanics.limits import (
    ANGLES, BASE_ANGLE_MAX, CLEARANCE_MIN, LEVER_MIN, LIMITS, limits_of, LOAD, OF_JOINTS, POSE,
    short_name, SPEED_MAX, TEMPERATURE_RISE_MAX, TORQUE_MAX)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reporting.spectrum import Density

_BLACK = ROLES['black']
_SOURCE_COLORS = dict(zip(SOURCES, (*LEG_COLORS, _BLACK), strict=True))

BASE_SECTION = 'base_wrench'

Places = Mapping[str, slice]
"""The curves of each quantity, by its name: their numbers in the report."""


class Curve(NamedTuple):
    """A line in a plot."""

    name: str
    color: str
    curve: int
    dash: str = 'solid'
    width: float = 1.6


class Bound(NamedTuple):
    """A horizontal line in a plot."""

    value: float
    text: str
    color: str = _BLACK


class Plot(NamedTuple):
    """A plot over time, or over frequency; the user selects one of its variants."""

    key: str  # Quantity.key of a quantity with a limit
    title: str
    unit: str
    variants: Mapping[str, Sequence[Curve]]
    note: str = ''
    bounds: Sequence[Bound] = ()
    log: bool = False
    contacts: bool = False  # shade the intervals with an external load
    spikes: bool = False
    """A few samples may be far larger than the others: they do not set the scale."""
    section: str = 'plots'  # where it is in the report
    spectrum: bool = False  # over frequency, both axes logarithmic

    def plain(self) -> dict[str, Any]:
        """Return the plot for JSON."""
        return self._asdict() | {
            'bounds': [bound._asdict() for bound in self.bounds],
            'variants': [{'name': name, 'curves': [curve._asdict() for curve in curves]}
                         for name, curves in self.variants.items()]}


def motion_plots(p: Parameters, at: Places, velocities_known: bool, first: Sequence[float],
                 ) -> list[Plot]:
    """
    Return the plots of motion and forces; those of velocities only if they are known.

    first: position of the first setpoint [m]; the curves of positions begin there.
    """
    joints, begin = p.joints, ', '.join(f'{each:.6g}' for each in first)
    kind, limits = p.leg_kind, limits_of(p)
    effort = kind.effort
    of_motion = [
        Plot('velocity', 'Velocity of the platform', 'm/s',
             _of_axes(at['velocity'], 'v x', 'v y', 'v z'), 'of its origin, base axes'),
        Plot('angular_velocity', 'Angular velocity of the platform', 'deg/s',
             _of_axes(at['angular_velocity'], 'w x', 'w y', 'w z'),
             'base axes; not the rates of alpha, beta, gamma'),
        Plot('acceleration', 'Acceleration of the platform', 'm/s²',
             _of_axes(at['acceleration'], 'a x', 'a y', 'a z'), 'of its origin, base axes'),
        Plot('angular_acceleration', 'Angular acceleration of the platform', 'deg/s²',
             _of_axes(at['angular_acceleration'], 'dw/dt x', 'dw/dt y', 'dw/dt z'), 'base axes')]
    of_rates = [
        *_of_results(p, at, limits.rates),
        Plot('powers', 'Mechanical power of the legs', 'W', _of_legs(joints, at['powers']),
             f'demanded {effort.name} times {kind.rate.name}; + drives, − brakes', spikes=True)]
    return [
        # one scale for all axes: the height above the base is far larger than the motion
        Plot('position', 'Inputs: position of the platform, from the first setpoint', 'm',
             _of_axes(at['position'], 'X', 'Y', 'Z'),
             f'of its origin, base axes; the first setpoint is at ({begin}) m'),
        Plot('angles', 'Inputs: orientation of the platform', 'deg',
             _of_axes(at['angles'], 'alpha', 'beta', 'gamma'), 'R = Rz(gamma) Ry(beta) Rx(alpha)'),
        *(of_motion if velocities_known else ()),
        *_of_results(p, at, kind.position_limits),
        *_of_results(p, at, [name for name in plotted(p) if name == LEVER_MIN]),
        *(_of_joints(p, limit, at['joint_angles'].start) for limit in OF_JOINTS
          if p[limit] is not None),
        *([] if p.limits.leg_clearance_min is None else [
            _bounded(p, [CLEARANCE_MIN], 'Clearance between the legs', at['clearances'],
                     'from each leg to the nearest other leg')]),
        Plot('determinant', 'det(J)', 'm³',
             {'': [Curve('det(J)', LEG_COLORS[0], at['determinant'].start)]},
             'zero at a singularity', [Bound(0.0, 'singular', ROLES['singular'])],
             spikes=True),
        Plot('condition', 'Condition number of J_inv', '–',
             {'': [Curve('condition', LEG_COLORS[1], at['condition'].start)]},
             'dimensionless; 1 is best', [
                 Bound(p.singularity.warn_condition, 'warn', ROLES['near']),
                 Bound(p.singularity.stop_condition, 'stop', ROLES['singular'])], log=True),
        *_of_results(p, at, limits.loads),
        *(of_rates if velocities_known else ()),
        *(_of_motors(p, at, velocities_known) if p.drives else ()),
        Plot('force_breakdown', f'Leg {effort.name} by source', effort.unit, {
            leg: [Curve('sum', ROLES['zero'], at[effort.name].start + n, width=4.5),
                  *(Curve(source, _SOURCE_COLORS[source], at['breakdown'].start + 6 * k + n)
                    for k, source in enumerate(sources_of(p)))]
            for n, leg in enumerate(joints)}, f'the parts of the demanded {effort.name}',
            spikes=True)]


def plotted(p: Parameters) -> list[str]:
    """Return the limits whose quantities are always known, and are plotted."""
    return [name for name in limits_of(p).known if LIMITS[name].usual or p[name] is not None]


def _of_results(p: Parameters, at: Places, names: Sequence[str]) -> Iterator[Plot]:
    """Yield the plots of quantities that are always known, each with its limits."""
    shown = [LIMITS[name] for name in names if name in plotted(p)]
    for quantity in dict.fromkeys(limit.quantity for limit in shown):
        limits = [limit for limit in shown if limit.quantity == quantity]
        yield _bounded(
            p, [limit.name for limit in limits], limits[0].title, at[quantity.key],
            limits[0].note, both=limits[0].depends != POSE, spikes=limits[0].depends == LOAD)


def _bounded(p: Parameters, limits: Sequence[str], title: str, channels: slice, note: str,
             both: bool = False, spikes: bool = False) -> Plot:
    """Return the plot of a quantity with limits, the lower one first; both: of either sign."""
    quantity = LIMITS[limits[0]].quantity
    return Plot(quantity.key, title, quantity.unit or '–', _of_legs(p.joints, channels), note,
                [bound for limit in limits for bound in _bounds(limit, p[limit], both)],
                spikes=spikes)


def _of_joints(p: Parameters, limit: str, first: int) -> Plot:
    """Return the plot of the angles of the joints that a limit bounds, in degrees."""
    which, joint = ANGLES[limit], 'base' if limit == BASE_ANGLE_MAX else 'platform'
    return Plot(
        LIMITS[limit].quantity.key, f'Angles of the {joint} joints', 'deg',
        _of_legs(p.joints, slice(first + which.start, first + which.stop)),
        f'between the leg and geometry.{joint}_joint_axes, by default its direction at home',
        _bounds(limit, np.degrees(p[limit])))


def base_wrench_plots(at: Places) -> list[Plot]:
    """Return the plots of the base wrench over time."""
    return [
        Plot('base_force', 'Force on the base', 'N',
             _all_or_one(_of_axes(at['base_force'], 'F x', 'F y', 'F z')),
             'of the whole hexapod, base axes', spikes=True, section=BASE_SECTION),
        Plot('base_moment', 'Moment on the base', 'N m',
             _all_or_one(_of_axes(at['base_moment'], 'M x', 'M y', 'M z')),
             "about the base's origin, base axes", spikes=True, section=BASE_SECTION)]


def spectrum_plots(density: Density, first: int) -> list[Plot]:
    """Return the plots of the spectra of the base wrench, whose curves begin at a number."""
    note = (f'amplitude spectral density up to the Nyquist rate; {density.segments} Hann '
            f'{"window" if density.segments == 1 else "windows"} of {density.seconds:.3g} s, '
            'without their means')
    if density.uneven:
        note += (f'; {100.0 * density.uneven:.2g} % of the steps in time are uneven, values are '
                 'interpolated: the upper half of the frequencies may be too low')
    return [
        Plot(f'base_{name}_spectrum', f'Spectrum of the {name} on the base', f'{unit}/√Hz',
             _of_axes(slice(begin, begin + 3), *(f'{letter} {axis}' for axis in 'xyz')), note,
             log=True, section=BASE_SECTION, spectrum=True)
        for name, unit, letter, begin in (
            ('force', 'N', 'F', first), ('moment', 'N m', 'M', first + 3))]


def measured_plots(p: Parameters, at: Places) -> list[Plot]:
    """Return the plots of a comparison with measured efforts."""
    effort = p.leg_kind.effort
    return [
        Plot('measured', f'Measured and computed leg {effort.name}', effort.unit, {
            leg: [Curve('measured', _BLACK, at['measured'].start + n),
                  Curve('computed', LEG_COLORS[n], at['computed'].start + n),
                  Curve('residual', ROLES['faint'], at['residual'].start + n, 'dot')]
            for n, leg in enumerate(p.joints)}, 'residual: measured less computed',
            contacts=True, spikes=True),
        Plot('residuals', 'Residual of every leg', effort.unit,
             _of_legs(p.joints, at['residual']), f'measured less computed {effort.name}',
             contacts=True, spikes=True),
        Plot('external_force', 'External force', 'N',
             _of_axes(at['external_force'], 'F x', 'F y', 'F z'),
             'J_inv^T (computed − measured): the load that the model does not include, base axes',
             contacts=True, spikes=True),
        Plot('external_moment', 'External moment', 'N m',
             _of_axes(at['external_moment'], 'M x', 'M y', 'M z'),
             "about the platform's origin, base axes", contacts=True, spikes=True)]


def uncertain_plots(p: Parameters, at: Places) -> list[Plot]:
    """Return the plot of the efforts within the uncertainty of the parameters."""
    effort, first = p.leg_kind.effort, at['uncertain'].start
    return [Plot(
        'uncertain', f'Leg {effort.name} on the hexapods that the file admits', effort.unit, {
            leg: [Curve('computed', LEG_COLORS[n], at[effort.name].start + n),
                  Curve('2.5 %', ROLES['faint'], first + n),
                  Curve('97.5 %', ROLES['faint'], first + 6 + n)]
            for n, leg in enumerate(p.joints)},
        '95 % of the hexapods are between the lines, at each setpoint', spikes=True)]


def _of_motors(p: Parameters, at: Places, velocities_known: bool) -> Iterator[Plot]:
    yield _bounded(p, [TORQUE_MAX], 'Torques of the motors', at['torques'],
                   'demanded by the motion, + extends', both=True, spikes=True)
    if velocities_known:
        yield _bounded(p, [SPEED_MAX], 'Speeds of the motors', at['speeds'], '+ extends',
                       both=True)
        if p.drive.resistance is not None:
            yield Plot('bus_power', 'Power of the bus', 'W', {
                '': [Curve('bus', _BLACK, at['bus_power'].start)]},
                'electrical, of all motors; − flows back', spikes=True)
    if p.drive.thermal_resistance is not None:
        yield _bounded(p, [TEMPERATURE_RISE_MAX], 'Temperature rises of the windings', at['rises'],
                       'above ambient, from ambient at the beginning')


def _of_legs(joints: Sequence[str], channels: slice) -> dict[str, list[Curve]]:
    return {'': [Curve(leg, color, channels.start + n) for n, (leg, color) in
                 enumerate(zip(joints, LEG_COLORS, strict=True))]}


def _of_axes(channels: slice, *names: str) -> dict[str, list[Curve]]:
    return {'': [Curve(name, color, channels.start + n) for n, (name, color) in
                 enumerate(zip(names, AXIS_COLORS, strict=True))]}


def _all_or_one(variants: Mapping[str, list[Curve]]) -> dict[str, list[Curve]]:
    """Return all curves as one variant, and each as one: the weight hides the others."""
    curves = variants['']
    return {'all': curves, **{curve.name: [curve] for curve in curves}}


def _bounds(limit: str, values: ArrayLike | None, both: bool = False) -> list[Bound]:
    """Return one line if the bound is the same for all legs, or one per leg in its color."""
    if values is None:
        return []
    of_legs = np.broadcast_to(values, 6)
    alike, name = bool(np.all(of_legs == of_legs[0])), short_name(limit)
    return [Bound(sign * float(value), name if alike else '', _BLACK if alike else color)
            for sign in ((1.0, -1.0) if both else (1.0,))
            for value, color in list(zip(of_legs, LEG_COLORS, strict=True))[:1 if alike else 6]]

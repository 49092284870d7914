# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The table of the parameters of a hexapod, and the rules between them.

The table is made from the attributes of class Parameters and of its groups, in their order. The
check, the node's declaration, ``--help`` and the documents are all made from it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
from typing import Any, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import CONSTANTS, Rule
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs import kind_of, KINDS, without_alternatives
from stewart_dynamics.legs.crank import BRANCHES
from stewart_dynamics.legs.kind import check_foreign, LegKind
from stewart_dynamics.parameters.body import Body, BodyError
from stewart_dynamics.parameters.circles import (
    BODIES, circle_names, joints_of, without_other)
from stewart_dynamics.parameters.parameter_set import (
    declare, LimitWords, Parameter, ParameterGroup, ParameterSet)
from stewart_dynamics.parameters.structure import broken_rule, LISTS, MOST_POINTS, structure_of
from stewart_dynamics.parameters.tolerances import (
    is_unit, REFLECTED_MASS_TOLERANCE, START_TOLERANCE, unit_rule)

if TYPE_CHECKING:
    from typing_extensions import Self

CENTER_UNCERTAINTY = 0.1  # default of uncertainty.center_of_mass, by the characteristic length
ONE_POINT = CONSTANTS['ONE_POINT']
"""Joints that are this near to their center, in terms of their coordinates, are at one point."""
NO_MASS = 1e-15
"""Mass of a platform in a cube on its radius that stands for none: forces are zero [kg/m^3]."""
STANDARD_GRAVITY = (0.0, 0.0, -9.80665)  # [m/s^2]
_LONGEST_PULSE = 0.02  # of servos: they take 50 pulses a second [s]
_HYSTERESIS = CONSTANTS['HYSTERESIS']


GUIDED, UNIVERSAL = 'guided', 'universal'  # values of drive.screw_rotation
RIGHT, LEFT = 'right', 'left'  # values of drive.screw_hand
MOTOR_INERTIA, SCREW_INERTIA = DRIVE_INERTIAS = 'drive.motor_inertia', 'drive.screw_inertia'
"""Parameters from which actuator.reflected_mass follows, where one of them is given."""
AUTO, POSITIVE, NEGATIVE = 'auto', 'positive', 'negative'  # values of geometry.platform_side
IGNORE, CHECK, PREPEND = 'ignore', 'check', 'prepend'  # values of trajectory.approach
OF_SETPOINTS, AS_MEASURED = 'setpoint', 'measured'  # values of joint_states.source
SPECIFIC_FORCE, ACCELERATION = 'specific_force', 'acceleration'  # values of cueing.input
WARN, SUPPRESS_FORCES = ACTIONS = 'warn', 'suppress_forces'  # of singularity.action, limits.action
SEPARATE, COMBINED, POSES_ALONE = 'separate', 'combined', 'pose'  # values of setpoint.source
FIXED, AT_REST, MOVING, BY_IMU = 'fixed', 'pose', 'motion', 'imu'  # values of base.source
LEG_SHAPE = 'legs.cylinder.radius', 'legs.cylinder.length', 'legs.piston.radius'
"""Parameters that the clearance of the legs needs."""
BASE_OUTLINE, PLATFORM_OUTLINE = OUTLINES = 'geometry.base_outline', 'geometry.platform_outline'
"""Parameters of the plates that the clearance counts for."""


def _legs(text: str, unit: str, default: Any = (0.0,), **rule: Any) -> Any:
    """Declare a value of each leg, or one for all."""
    return declare(text, unit, default, sizes=(1, 6), **rule)


def _limit(text: str, unit: str, quantity: str, phrase: str, *, title: str = '', note: str = '',
           usual: bool = False, **rule: Any) -> Any:
    """
    Declare a limit of each leg, unlimited if it is not set.

    It is checked where ``STEWART_LIMITS`` in ``core/stewart_dynamics.h`` has a line of its name.
    """
    words = LimitWords(quantity, phrase, title=title, note=note, usual=usual)
    return _legs(f'{text}; unlimited if not set', unit, (),
                 **{'minimum': 0.0, 'above': True, 'limit': words, **rule})


def _point(text: str, unit: str = 'm', default: Any = (0.0, 0.0, 0.0), **rule: Any) -> Any:
    """Declare three coordinates."""
    return declare(text, unit, default, sizes=(3,), **rule)


def _radius(body: str) -> Any:
    _, angles, _ = circle_names(body)
    return declare(f'radius of the circle of the {body} joints about the origin of the {body} '
                   f'frame, with {angles}: in place of geometry.{body}_joints', 'm', minimum=0.0,
                   above=True)


def _angles(body: str) -> Any:
    return declare(f'angle of each {body} joint on its circle, leg by leg, about the z axis of '
                   f'the {body} frame, from x toward y', 'rad', (), sizes=(6,),
                   minimum=-2.0 * math.pi, maximum=2.0 * math.pi)


def _height(body: str) -> Any:
    return declare(f'z of the {body} joints on their circle', 'm', 0.0)


class GeometryGroup(ParameterGroup):
    """The joints of the legs, and the outlines of base and platform."""

    base_joints: Array = declare(
        'x y z of the six base joints, leg by leg, base frame', 'm', required=True, sizes=(18,),
        instead=circle_names('base')[:2])
    platform_joints: Array = declare(
        'x y z of the six platform joints, in the same order, platform frame', 'm', required=True,
        sizes=(18,), instead=circle_names('platform')[:2])
    base_radius: float | None = _radius('base')
    base_angles: Array | None = _angles('base')
    base_height: float = _height('base')
    platform_radius: float | None = _radius('platform')
    platform_angles: Array | None = _angles('platform')
    platform_height: float = _height('platform')
    base_joint_axes: Array | None = declare(
        'x y z of the direction from which the angle of each base joint is measured, toward the '
        'platform, of any length, base axes; default: along the leg at the home pose', '', (),
        sizes=(18,))
    platform_joint_axes: Array | None = declare(
        'x y z of the direction from which the angle of each platform joint is measured, from the '
        'base toward the platform, of any length, platform axes; default: along the leg at the '
        'home pose', '', (), sizes=(18,))
    base_outline: Array | None = declare(
        'x y z of the corners of a flat convex plate of the base, in order, base frame; pistons '
        'keep limits.leg_clearance_min from it', 'm', (), sizes=(3,), repeated=True)
    platform_outline: Array | None = declare(
        'x y z of the corners of a flat convex plate of the platform, in order, platform frame; '
        'cylinders keep limits.leg_clearance_min from it', 'm', (), sizes=(3,), repeated=True)
    platform_side: str = declare(
        'side of the base joints on which the platform is. positive: the side to which the base '
        'axis most nearly normal to their plane, usually z, points; negative: the other side; '
        'auto: positive, unless only the other side has a level pose within the limits of length',
        '', AUTO, choices=(AUTO, POSITIVE, NEGATIVE))
    zero_length: Array = _legs(
        'length of a leg at which its published position is zero', 'm', minimum=0.0)
    crank_angles: Array | None = declare(
        'heading of each crank at its angle 0, about the z axis of the base, from x toward y; the '
        'axes of the motors are level, and a positive angle lifts the end of the crank', 'rad', (),
        sizes=(6,), minimum=-2.0 * math.pi, maximum=2.0 * math.pi)
    crank_axes: Array | None = declare(
        'x y z of the axis of each motor, of any length, base axes: angles are positive by the '
        'right-hand rule; with geometry.crank_directions in place of geometry.crank_angles', '',
        (), sizes=(18,))
    crank_directions: Array | None = declare(
        'x y z of the direction of each crank at its angle 0, of any length, base axes, '
        'perpendicular to its axis within 0.001 rad', '', (), sizes=(18,))
    crank_branch: tuple[str, ...] = declare(
        'sign of the lever of each crank: positive: a positive angle pushes the platform joint '
        'away; auto: the one whose angle at home is within the limits and nearer to zero than a '
        'quarter turn', '', (AUTO,), sizes=(1, 6), choices=BRANCHES)


class PlatformGroup(ParameterGroup):
    """The empty platform."""

    mass: float = declare('mass of the empty platform', 'kg', required=True, minimum=0.0,
                          above=True, while_active=True)
    center_of_mass: Array = _point(
        'center of mass of the empty platform, from the platform frame', while_active=True)
    inertia: Array = declare(
        'ixx ixy ixz iyy iyz izz of the empty platform, about its center of mass, platform axes',
        'kg m^2', required=True, sizes=(6,), while_active=True)

    @property
    def body(self) -> Body:
        """Return the three as one."""
        return Body(self.mass, self.center_of_mass, self.inertia)


class PayloadGroup(ParameterGroup):
    """A payload on the platform, and its identification by the node."""

    mass: float = declare(
        'mass of a payload on the platform, a driver for example; 0: none, and the other two have '
        'no effect', 'kg', 0.0, minimum=0.0, while_active=True)
    center_of_mass: Array = _point(
        'center of mass of the payload, from the platform frame', while_active=True)
    inertia: Array = declare(
        'ixx ixy ixz iyy iyz izz of the payload, about its center of mass, platform axes; 0: a '
        'point mass', 'kg m^2', (0.0,) * 6, sizes=(6,), while_active=True)
    window: float = declare(
        'time of the measurements that ~/identify_payload uses, the last ones', 's', 10.0,
        minimum=2.0, maximum=60.0)

    @property
    def body(self) -> Body:
        """Return the first three as one; zeros without a payload."""
        if self.mass == 0.0:
            return Body(0.0, np.zeros(3), np.zeros(6))
        return Body(self.mass, self.center_of_mass, self.inertia)


class LegPartGroup(ParameterGroup):
    """A part of a leg."""

    mass: Array
    center_of_mass: Array
    inertia: Array
    radius: Array | None


class CylinderGroup(LegPartGroup):
    """The lower part of a leg."""

    mass: Array = _legs('mass of a cylinder, the lower part of a leg', 'kg', minimum=0.0)
    center_of_mass: Array = _legs('distance of its center of mass from the base joint', 'm')
    inertia: Array = _legs('transverse inertia about its center of mass', 'kg m^2', minimum=0.0)
    radius: Array | None = _legs(
        'outer radius of a cylinder, for limits.leg_clearance_min', 'm', (), minimum=0.0)
    length: Array | None = _legs(
        'length of a cylinder from the base joint, for limits.leg_clearance_min', 'm', (),
        minimum=0.0)


class PistonGroup(LegPartGroup):
    """The upper part of a leg."""

    mass: Array = _legs('mass of a piston, the upper part of a leg', 'kg', minimum=0.0)
    center_of_mass: Array = _legs('distance of its center of mass from the platform joint', 'm')
    inertia: Array = _legs('transverse inertia about its center of mass', 'kg m^2', minimum=0.0)
    radius: Array | None = _legs(
        'outer radius of a piston, for limits.leg_clearance_min; at most that of the cylinder',
        'm', (), minimum=0.0)


class CrankGroup(ParameterGroup):
    """The cranks, which the motors turn."""

    length: Array | None = _legs(
        'length of a crank, from the axis of its motor to its end; with it, the hexapod has '
        'cranks', 'm', (), minimum=0.0, above=True)
    mass: Array = _legs('mass of a crank', 'kg', minimum=0.0)
    center_of_mass: Array = declare(
        'center of mass of a crank from the axis of its motor: along the crank, or x y z along '
        'the crank, in the direction of positive angles, and along the axis', 'm', (0.0,),
        sizes=(1, 3, 6, 18))
    inertia: Array = declare(
        'inertia of a crank about its center of mass: about the axis of the motor, or xx xy xz yy '
        'yz zz in the axes of its center of mass', 'kg m^2', (0.0,), sizes=(1, 6, 36))


class RodGroup(ParameterGroup):
    """The rods between cranks and platform."""

    length: Array | None = _legs(
        'length of a rod, between the centers of its joints', 'm', (), minimum=0.0, above=True)
    mass: Array = _legs('mass of a rod', 'kg', minimum=0.0)
    center_of_mass: Array | None = _legs(
        'distance of its center of mass from the end of the crank; default: the middle', 'm', ())
    inertia: Array | None = _legs(
        'transverse inertia about its center of mass; default: of a uniform rod, m L^2 / 12',
        'kg m^2', (), minimum=0.0)


class LegsGroup(ParameterGroup):
    """The parts of the legs."""

    cylinder: CylinderGroup
    piston: PistonGroup
    crank: CrankGroup
    rod: RodGroup

    @property
    def parts(self) -> dict[str, LegPartGroup]:
        """Return both by their names."""
        return {'cylinder': self.cylinder, 'piston': self.piston}


class ActuatorGroup(ParameterGroup):
    """Inertia and friction of the actuators, along the legs."""

    reflected_mass: Array = _legs(
        'inertia of rotor and screw along the leg, J (2 pi / lead)^2', 'kg', minimum=0.0)
    reflected_inertia: Array = _legs(
        'inertia of rotor and gear at the shaft of a crank', 'kg m^2', minimum=0.0)
    viscous_friction: Array = _legs(
        'viscous friction along the leg; of cranks at their shafts, in N m s/rad', 'N s/m',
        minimum=0.0)
    coulomb_friction: Array = _legs(
        'Coulomb friction along the leg; of cranks at their shafts, in N m', 'N', minimum=0.0)
    coulomb_velocity: Array = _legs(
        'rate of the leg below which Coulomb friction is linear; of cranks in rad/s, 0.01 by '
        'default', 'm/s', (1e-3,), minimum=0.0, above=True)
    screw_lead: Array | None = _legs(
        'travel of a leg in one turn of its screw; needed by drive.*', 'm', (), minimum=0.0,
        above=True)


def _universal_axes(end: str) -> Any:
    return declare(f'x y z of the axis of each universal joint that is fixed to the {end}, {end} '
                   'axes, for drive.screw_rotation: universal; default: across the leg at the '
                   'home pose, in the plane of the base joints', '', (), sizes=(18,))


class DriveGroup(ParameterGroup):
    """Screws, gears and motors."""

    gear_ratio: Array = _legs(
        'turns of the motor in one turn of the screw', '', (1.0,), minimum=0.0, above=True)
    motor_inertia: Array = _legs(
        'inertia of rotor, brake and gear at the shaft of the motor; actuator.reflected_mass '
        'follows from it', 'kg m^2', minimum=0.0)
    screw_inertia: Array = _legs(
        'inertia at the screw; actuator.reflected_mass follows from it', 'kg m^2', minimum=0.0)
    efficiency: Array = _legs(
        'of screw and gear together where the motor drives the leg; near standstill, below '
        'actuator.coulomb_velocity, its effect is linear in the rate', '', (1.0,), minimum=0.0,
        above=True, maximum=1.0)
    back_driving_efficiency: Array = _legs(
        'the same where the leg drives the motor, 0 or less for a self-locking screw; by default '
        '2 - 1 / drive.efficiency', '', (), minimum=-100.0, maximum=1.0)
    torque_max: Array | None = _limit(
        'maximum torque of a motor, to which torques are clipped', 'N m', 'motor torque',
        'torque of a motor')
    torque_continuous: Array | None = _legs(
        'torque that a motor can hold without end, for the RMS torque of a motion', 'N m', (),
        minimum=0.0, above=True)
    torque_speed: Array | None = declare(
        'largest torque of a motor at rising speeds, speed and torque of one point after the '
        'other, linear between them; from 0 rad/s to the first speed the first torque, above the '
        'last speed 0 N m; unlimited if not set', 'rad/s, N m', (), sizes=(2,), repeated=True,
        minimum=0.0, limit=LimitWords('motor torque', 'torque of a motor at its speed', 'N m'))
    speed_max: Array | None = _limit(
        'maximum speed of a motor', 'rad/s', 'motor speed', 'speed of a motor')
    torque_constant: Array | None = _legs(
        'torque of a motor for each ampere', 'N m/A', (), minimum=0.0, above=True)
    resistance: Array | None = _legs(
        'copper heat of a motor divided by the square of its current: with RMS currents of three '
        'phases 1.5 times the resistance between two phases', 'Ohm', (), minimum=0.0)
    thermal_resistance: Array | None = _legs(
        'from winding to ambient', 'K/W', (), minimum=0.0, above=True)
    thermal_time_constant: Array | None = _legs(
        'of the winding with its motor', 's', (), minimum=0.0, above=True)
    temperature_rise_max: Array | None = _limit(
        'maximum temperature of a winding above ambient', 'K', 'temperature rise',
        'temperature of a winding')
    rated_torque: Array | None = _legs(
        'torque that the amplifier calls 1000 per mille, object 6076h of CiA 402; for '
        'stewart_export --drives', 'N m', (), minimum=0.0, above=True)
    counts_per_turn: Array | None = _legs(
        'increments of position in one turn of the motor, as the amplifier counts them; for '
        'stewart_export --drives', '', (), minimum=0.0, above=True)
    direction: Array = _legs(
        '1.0 if positive torque and position of the amplifier extend the leg or drive the angle '
        'up, else -1.0; for stewart_export --drives', '', (1.0,), minimum=-1.0, maximum=1.0)
    counts_at_zero: Array | None = _legs(
        'increments where the position is zero, as a servo on a bus counts them: 2048 in the '
        'middle of a turn; for stewart_export --drives', '', ())
    current_unit: Array | None = _legs(
        'current that a servo on a bus counts as 1: 0.00269 of a Dynamixel XM430; for '
        'stewart_export --drives', 'A', (), minimum=0.0, above=True)
    speed_unit: Array | None = _legs(
        'speed that a servo on a bus counts as 1: 0.023981, 0.229 rpm, of a Dynamixel X; for '
        'stewart_export --drives', 'rad/s', (), minimum=0.0, above=True)
    screw_rotation: str = declare(
        'guided: screw and nut cannot turn with the leg; universal: the leg turns between its '
        'universal joints, and its motor makes up for it', '', GUIDED, choices=(GUIDED, UNIVERSAL))
    screw_hand: str = declare(
        'hand of the thread, for drive.screw_rotation: universal', '', RIGHT,
        choices=(RIGHT, LEFT))
    base_universal_axes: Array | None = _universal_axes('base')
    platform_universal_axes: Array | None = _universal_axes('platform')


_ANGLES: dict[str, Any] = {'title': 'Crank angles', 'usual': True}
_LENGTHS: dict[str, Any] = {
    'title': 'Leg lengths', 'note': 'between the joint centers', 'usual': True}


class ServoGroup(ParameterGroup):
    """Hobby servos: two points of each, whose pulse and angle were measured."""

    pulse_min: Array = _legs(
        'shortest pulse of a servo, never shorter', 's', (0.0005,), minimum=0.0,
        maximum=_LONGEST_PULSE)
    pulse_max: Array = _legs(
        'longest pulse of a servo, never longer', 's', (0.0025,), minimum=0.0, above=True,
        maximum=_LONGEST_PULSE)
    angle_at_min: Array | None = _legs(
        'angle of the crank at servo.pulse_min, measured: an offset, and a servo that turns the '
        'other way, are in it', 'rad', (), minimum=-2.0 * math.pi, maximum=2.0 * math.pi)
    angle_at_max: Array | None = _legs(
        'angle of the crank at servo.pulse_max, measured', 'rad', (), minimum=-2.0 * math.pi,
        maximum=2.0 * math.pi)


class LimitsGroup(ParameterGroup):
    """Limits of legs and joints."""

    length_min: Array | None = _limit(
        'minimum length of a leg', 'm', 'length', 'shortest leg', above=False, **_LENGTHS)
    length_max: Array | None = _limit(
        'maximum length of a leg', 'm', 'length', 'longest leg', **_LENGTHS)
    velocity_max: Array | None = _limit(
        'maximum rate of a leg', 'm/s', 'rate', 'speed of a leg', title='Leg rates',
        note='+ extends', usual=True)
    force_max: Array | None = _limit(
        'maximum force of a leg, to which forces are clipped', 'N', 'force', 'force of a leg',
        title='Leg forces', note='demanded by the motion, + pushes', usual=True)
    joint_force_max: Array | None = _limit(
        'maximum force along a leg that its joints and its rod carry, the thrust rating of a '
        'cylinder: without friction and reflected mass of the actuator', 'N', 'joint force',
        'force in a joint', title='Forces in the joints',
        note='along the legs, without friction and reflected mass of the actuators, + pushes')
    base_joint_angle_max: Array | None = _limit(
        'maximum angle between a leg and its geometry.base_joint_axes', 'rad',
        'base joint angle', 'joint angle at the base', maximum=math.pi)
    platform_joint_angle_max: Array | None = _limit(
        'maximum angle between a leg and its geometry.platform_joint_axes', 'rad',
        'platform joint angle', 'joint angle at the platform', maximum=math.pi)
    angle_min: Array | None = _limit(
        'smallest angle of a crank', 'rad', 'angle', 'smallest angle',
        minimum=-math.inf, above=False, **_ANGLES)
    angle_max: Array | None = _limit(
        'largest angle of a crank', 'rad', 'angle', 'largest angle',
        minimum=-math.inf, above=False, **_ANGLES)
    speed_max: Array | None = _limit(
        'maximum speed of a crank', 'rad/s', 'speed', 'speed of a crank', title='Crank speeds',
        usual=True)
    torque_max: Array | None = _limit(
        'maximum torque of a crank at its shaft, to which torques are clipped', 'N m', 'torque',
        'torque of a crank', title='Crank torques',
        note='demanded by the motion, + drives the angle up', usual=True)
    rod_force_max: Array | None = _limit(
        'maximum force along a rod, at either end', 'N', 'rod force', 'force of a rod',
        title='Forces in the rods', note='along the rods, at the end where they are larger')
    lever_min: Array | None = _limit(
        'smallest magnitude of the lever of a crank, by the length of the crank: 0 at a dead '
        'centre, 1 at the best; 0.1 by default', '', 'lever', 'lever of a crank', above=False,
        maximum=1.0, title='Crank levers', note='by their largest values: 0 at a dead centre')
    leg_clearance_min: float | None = declare(
        'minimum distance of the surface of a leg, a cylinder and a thinner piston, from that of '
        'another leg, and from the outlines of geometry that are given; unlimited if not set',
        'm', minimum=0.0, limit=LimitWords('clearance', 'clearance between legs'))
    action: str = declare(
        'action while a limit of length, rate, joint force, joint angle or clearance, or of speed '
        'or temperature of a motor, is exceeded, or a setpoint is too far from the last one for '
        'limits.velocity_max: warn only, or publish no forces and torques', '', WARN,
        choices=ACTIONS, while_active=True)


class SingularityGroup(ParameterGroup):
    """How near a singularity setpoints may be."""

    characteristic_length: float = declare(
        'length by which moments are divided in the condition number; default: mean distance of '
        'the platform joints from their center', 'm', minimum=0.0, above=True)
    warn_condition: float = declare(
        'condition number of J_inv at which the singularity warning begins; it ends below '
        f'{_HYSTERESIS:g} of this', '', 20.0, minimum=1.0, while_active=True)
    stop_condition: float = declare(
        'condition number at which singularity.action begins; it ends below '
        f'{_HYSTERESIS:g} of this', '', 100.0, minimum=1.0, while_active=True)
    warn_time: float = declare(
        'warn when the predicted time to a crossing of det(J) = 0 is shorter than this', 's', 0.5,
        minimum=0.0, while_active=True)
    action: str = declare(
        'action above stop_condition: warn only, or publish no forces', '', WARN, choices=ACTIONS,
        while_active=True)


class SetpointGroup(ParameterGroup):
    """How setpoints arrive."""

    source: str = declare(
        'setpoints on three topics, on one combined topic, or poses alone (quasi-static: no '
        'motion terms)', '', SEPARATE, choices=(SEPARATE, COMBINED, POSES_ALONE))
    sync_tolerance: float = declare(
        'largest difference between the stamps of one setpoint', 's', 0.0, minimum=0.0,
        maximum=1e9)
    timeout: float = declare(
        'time without setpoints after which they are stale; a longer jump back in time is a '
        'restart', 's', 0.1, minimum=0.0, above=True, maximum=1e9)
    exclusive: bool = declare(
        'reject setpoints and base motion while a topic of them has more than one publisher',
        default=False)


class ImuGroup(ParameterGroup):
    """An IMU on the base."""

    position: Array = _point('position of the IMU, base frame')
    orientation: Array = declare(
        'quaternion x y z w that turns IMU axes into base axes', '', (0.0, 0.0, 0.0, 1.0),
        sizes=(4,))
    cutoff: float = declare(
        'cut-off frequency of the low-pass filter on the angular acceleration, the derivative of '
        'the angular velocity', 'Hz', 20.0, minimum=0.0, above=True)


class BaseGroup(ParameterGroup):
    """How the base moves."""

    source: str = declare(
        'how the base moves: not at all, by its orientation in the world (~/base/pose, at rest), '
        'by its motion in the world (~/base/pose, twist and accel), or as an IMU on it measures '
        '(~/base/imu)', '', FIXED, choices=(FIXED, AT_REST, MOVING, BY_IMU))
    timeout: float = declare(
        'age of the last base motion above which no forces are published', 's', 0.1, minimum=0.0,
        above=True, maximum=1e9)
    imu: ImuGroup


class TrajectoryGroup(ParameterGroup):
    """Planned trajectories."""

    effort: bool = declare(
        'publish forces with the points of ~/leg_trajectory; a joint_trajectory_controller '
        'without an effort command interface rejects points with effort', default=True)
    approach: str = declare(
        'where ~/platform_trajectory may start: anywhere; check: where the measured legs are, to '
        f'{100.0 * START_TOLERANCE:g} % of singularity.characteristic_length; prepend: a motion '
        'from rest there to the first point is put before it', '', IGNORE,
        choices=(IGNORE, CHECK, PREPEND))


OF_DRIVES, MOTOR_TORQUES, MOTOR_CURRENTS = EFFORTS = (
    'drives', 'motor_torques', 'motor_currents')


class ExternalWrenchGroup(ParameterGroup):
    """The wrench on the platform that measured efforts show."""

    efforts: str = declare(
        'what the efforts on ~/measured_legs are: those of the drives, as ~/leg_states has them, '
        'torques of the motors, or their currents', '', OF_DRIVES, choices=EFFORTS)
    cutoff: float = declare(
        'cut-off frequency of the low-pass filter on ~/external_wrench', 'Hz', 10.0, minimum=0.0,
        above=True, while_active=True)
    force_max: float | None = declare(
        'external force above which diagnostics report an ERROR; unlimited if not set', 'N',
        minimum=0.0, above=True, while_active=True)
    moment_max: float | None = declare(
        "external moment at the platform's origin above which diagnostics report an ERROR; "
        'unlimited if not set', 'N m', minimum=0.0, above=True, while_active=True)


_OF_HEAD, _OF_TILT = 'surge, sway, heave', 'surge, sway'


def _axes(text: str, unit: str, default: tuple[float, ...], **rule: Any) -> Any:
    """Declare a value of motion cueing for each axis."""
    return declare(text, unit, default, sizes=(len(default),), while_active=True, **rule)


def _gains(text: str, default: tuple[float, ...]) -> Any:
    return _axes(text, '', default, minimum=0.0, maximum=10.0)


def _frequencies(text: str, default: tuple[float, ...]) -> Any:
    return _axes(text, 'rad/s', default, minimum=0.0, above=True, maximum=100.0)


def _damping(text: str, default: tuple[float, ...]) -> Any:
    return _axes(text, '', default, minimum=0.5, maximum=10.0)


class TranslationGroup(ParameterGroup):
    """Translation of the head, from quick changes of the acceleration."""

    gain: Array = _gains(
        f'share of the acceleration that translation gives, {_OF_HEAD}', (0.5,) * 3)
    natural_frequency: Array = _frequencies(
        f'natural frequency of the high-pass filter of second order, {_OF_HEAD}', (2.5, 4.0, 4.0))
    damping: Array = _damping(f'damping ratio of this filter, {_OF_HEAD}', (1.0,) * 3)
    washout_frequency: Array = _frequencies(
        'frequency of the high-pass filter of first order that returns the head to its place, '
        f'{_OF_HEAD}', (0.25, 0.4, 0.4))


class TiltGroup(ParameterGroup):
    """Tilt, in place of lasting acceleration."""

    gain: Array = _gains(f'share of the acceleration that tilt gives, {_OF_TILT}', (0.5,) * 2)
    natural_frequency: Array = _frequencies(
        f'natural frequency of the low-pass filter of second order, {_OF_TILT}', (5.0, 8.0))
    damping: Array = _damping(f'damping ratio of this filter, {_OF_TILT}', (1.0,) * 2)
    rate_max: float = declare(
        'maximum rate of the tilt: below it, it is not felt as rotation', 'rad/s', 0.0524,
        minimum=0.0, above=True, maximum=100.0, while_active=True)


class RotationGroup(ParameterGroup):
    """Rotation, from the angular velocity."""

    gain: Array = _gains(
        'share of the angular velocity that rotation gives, roll, pitch, yaw', (0.5,) * 3)
    natural_frequency: Array = _frequencies(
        'frequency of the high-pass filter of first order, roll, pitch, yaw', (1.0,) * 3)


class CueingGroup(ParameterGroup):
    """Motion cueing."""

    head: Array = _axes(
        "position of the pilot's head, platform frame", 'm', (0.0, 0.0, 0.0))
    input: str = declare(
        'linear acceleration of the vehicle at the head: specific_force, with gravity, as an '
        'accelerometer measures it; acceleration: without', '', SPECIFIC_FORCE,
        choices=(SPECIFIC_FORCE, ACCELERATION), while_active=True)
    translation: TranslationGroup
    tilt: TiltGroup
    rotation: RotationGroup
    rate: float = declare(
        'rate of the setpoints of stewart_cueing', 'Hz', 250.0, minimum=10.0, maximum=1e4)
    govern: bool = declare(
        'keep every setpoint within the limits of this file, with a stop from it within them',
        default=True, while_active=True)


def _deviation(text: str, unit: str, default: float | None) -> Any:
    return declare(f'standard deviation of {text}; a prior of stewart_identify and '
                   '~/identify_payload, drawn by --uncertainty of programs', unit, default,
                   minimum=0.0)


class UncertaintyGroup(ParameterGroup):
    """Standard deviations of the parameters of the file."""

    platform_mass: float = _deviation('platform.mass, relative to it', '', 0.5)
    center_of_mass: float = _deviation(
        f'each coordinate of platform.center_of_mass; default: {CENTER_UNCERTAINTY:g} of '
        'singularity.characteristic_length', 'm', None)
    inertia: float = _deviation(
        'platform.inertia, relative to its mean principal moment', '', 1.0)
    leg_mass: float = _deviation(
        'masses, centers of mass and inertias of the parts of the legs, relative to them: once of '
        'all legs together, and again of each leg', '', 0.05)
    reflected_mass: float = _deviation(
        'actuator.reflected_mass or reflected_inertia of each leg, relative to it', '', 0.1)
    effort_gain: float = _deviation(
        'the gain of measured efforts, of all legs together', '', 0.01)
    tilt: float = _deviation(
        'the direction of gravity in the base frame, about each of two axes', 'rad', 0.005)


def _mesh(body: str) -> Any:
    return declare(f'file of the mesh of {body}, as stewart_describe writes it; empty: a simple '
                   'shape', default='')


def _offset(axes: str) -> Any:
    return declare(f'x y z, and roll pitch yaw, of this mesh; {axes}', 'm, rad', (0.0,) * 6,
                   sizes=(6,))


class MeshesGroup(ParameterGroup):
    """Pictures of the parts."""

    base: str = _mesh('base')
    base_offset: Array = _offset('base frame')
    platform: str = _mesh('platform')
    platform_offset: Array = _offset('platform frame')
    cylinder: str = _mesh('each cylinder')
    cylinder_offset: Array = _offset('z along the leg, from the base joint')
    piston: str = _mesh('each piston')
    piston_offset: Array = _offset('z along the leg, from the platform joint')
    scale: float = declare(
        'scale of all meshes; 0.001 for files in mm', '', 1.0, minimum=0.0, above=True)


class JointStatesGroup(ParameterGroup):
    """Poses of the hexapod in RViz."""

    source: str = declare(
        'whose poses ~/joint_states and /tf have: those of setpoints, or of the measured legs '
        '(~/measured_legs)', '', OF_SETPOINTS, choices=(OF_SETPOINTS, AS_MEASURED))


class Parameters(ParameterSet):
    """The parameters of a hexapod and of the node that computes its leg forces."""

    base_frame: str = declare('frame of setpoints and wrenches', default='base')
    platform_frame: str = declare('frame that moves with the platform', default='platform')
    joints: tuple[str, ...] = declare(
        'names of the legs, in the order of all arrays of six',
        default=tuple(f'leg_{n}' for n in range(1, 7)), sizes=(6,))
    geometry: GeometryGroup
    platform: PlatformGroup
    payload: PayloadGroup
    legs: LegsGroup
    actuator: ActuatorGroup
    drive: DriveGroup
    servo: ServoGroup
    gravity: Array = _point(
        'acceleration of free fall: base axes; axes of the world where base.source is pose or '
        'motion; not used where it is imu', 'm/s^2', STANDARD_GRAVITY)
    limits: LimitsGroup
    singularity: SingularityGroup
    setpoint: SetpointGroup
    base: BaseGroup
    world_frame: str = declare('frame of ~/base/pose, twist and accel', default='world')
    trajectory: TrajectoryGroup
    external_wrench: ExternalWrenchGroup
    cueing: CueingGroup
    uncertainty: UncertaintyGroup
    meshes: MeshesGroup
    visualization_rate: float = declare(
        'maximum rate of ~/markers and ~/joint_states; 0: off', 'Hz', 30.0, minimum=0.0)
    publish_tf: bool = declare(
        'publish the transform from base_frame to platform_frame on /tf, with every pose',
        default=False)
    joint_states: JointStatesGroup
    autostart: bool = declare('configure and activate the node when it starts', default=True)

    node = 'stewart_dynamics'
    # The reflected inertia may follow from drive.*; heights belong to circles.
    described = ('cueing.', 'drive.', 'actuator.reflected_',
                 *(circle_names(body)[2] for body in BODIES))
    drives: tuple[str, ...]  # names of drive.* that are given; without them no motors are computed
    carried: Body  # by the legs: platform and payload as one
    leg_kind: LegKind
    structure: Records  # () for the functions in C, without axes of joints: ``hexapod_structure``

    def _check_together(self, source: str) -> None:
        """Check the rules between parameters."""
        for body in BODIES:
            self._complete(f'geometry.{body}_joints', joints_of(self, body, source))
        joints = self.joints
        if len(set(joints)) < 6 or '' in joints:
            raise ParameterError(f'{source}: joints: {list(joints)}: six different names needed')
        length = float(np.linalg.norm(self.base.imu.orientation))
        if not is_unit(length):
            raise ParameterError(f'{source}: base.imu.orientation: '
                                 f'{self.base.imu.orientation.tolist()}: {unit_rule(length)}')
        for name in LISTS.values():
            if self[name] is not None and len(self[name]) > MOST_POINTS:
                raise ParameterError(
                    f'{source}: {name}: {len(self[name])} points: must be at most {MOST_POINTS}')
        self.leg_kind = kind_of(self)
        check_foreign(self, self.leg_kind, KINDS, source)
        self.leg_kind.check(self, source)
        self._check_drives(source)
        self.structure = structure_of(self, bool(self.drives), SUPPRESS_FORCES)
        self._check_reflected_mass(source)
        if (broken := broken_rule(self.structure)) is not None:
            raise ParameterError(f'{source}: {self._broken_words(*broken)}')
        self._complete_derived()
        self._check_efforts(source)
        self._carry_payload(source)

    def _broken_words(self, rule: Rule, where: int) -> str:
        """Return which parameter breaks a rule of the structure, its value and the rule."""
        names, text = rule.parameters, rule.text
        if text.startswith('not set'):
            return f'{", ".join(each for each in names if self[each] is None)}: {text}'
        name = names[max(where, 0)] if len(names) == 2 else names[0]
        if name not in self.table:
            return f'{name}: {text}'
        if rule.name == 'ONE_POINT':
            return ('geometry.platform_angles' if self.geometry.platform_angles is not None
                    else name) + f': {text}'
        value = np.asarray(self[name])
        if where >= 0 and value.ndim == 2 and name.startswith(self.leg_kind.own) and (
                self.leg_kind.marker):
            return f'{name}: {self.joints[where]}: {value[where].tolist()}: {text}'
        words = f'{name}: {value.tolist()}: {text}'
        other = text.rpartition(' ')[2]
        if other in self.table:
            words += f', {np.asarray(self[other]).tolist()}'
        if rule.name == 'INERTIA':
            words += _smallest_moment(value)
        elif rule.name == 'TORQUE_SPEED':
            words = (f'{name}: speeds {value[:, 0].tolist()} rad/s: must be strictly increasing '
                     '(the order is speed, torque, speed, torque, ...)')
        return words

    def _complete_derived(self) -> None:
        """Set parameters that follow from others."""
        legs = self.structure['legs']
        if self.singularity.characteristic_length is None:
            self._complete('singularity.characteristic_length',
                           float(self.structure['characteristic_length']))
        if self.uncertainty.center_of_mass is None:
            self._complete('uncertainty.center_of_mass',
                           CENTER_UNCERTAINTY * self.singularity.characteristic_length)
        if self.drive.back_driving_efficiency is None:
            self._complete('drive.back_driving_efficiency', legs['back_driving_efficiency'].copy())
        self._complete(self.leg_kind.fields['reflected_mass'], legs['reflected_mass'].copy())
        for field, name in self.leg_kind.fields.items():
            if self[name] is None and np.isfinite(legs[field]).all():
                self._complete(name, legs[field].copy())

    def _check_efforts(self, source: str) -> None:
        """Check that measured efforts can be taken as those of the drives."""
        efforts = self.external_wrench.efforts
        needed = {OF_DRIVES: [], MOTOR_TORQUES: [self.leg_kind.ratio],
                  MOTOR_CURRENTS: [self.leg_kind.ratio, 'drive.torque_constant']}[efforts]
        for name in filter(None, needed):
            if self[name] is None:
                raise ParameterError(
                    f'{source}: {name}: not set: needed by external_wrench.efforts: {efforts}')
        back = self.drive.back_driving_efficiency
        if efforts != OF_DRIVES and back is not None and not back.min() > 0.0:
            raise ParameterError(
                f'{source}: external_wrench.efforts: {efforts}: drive.back_driving_efficiency, '
                f'{back.min():g}, must be more than 0: the torque at a self-locking '
                f'{self.leg_kind.gear} does not show its load')

    def _check_reflected_mass(self, source: str) -> None:
        """Check the reflected inertia that is given against the one that follows from drive.*."""
        name, unit = self.leg_kind.fields['reflected_mass'], self.leg_kind.inertia_unit
        causes = ' and '.join(
            each for each in DRIVE_INERTIAS if not each.startswith(self.leg_kind.foreign))
        follows, given = self.structure['legs']['reflected_mass'], self[name]
        wrong = np.abs(given - follows) > REFLECTED_MASS_TOLERANCE * follows
        if name in self.given and wrong.any():
            leg = int(np.argmax(wrong))
            raise ParameterError(
                f'{source}: {name}: {given[leg]:g} {unit}: contradicts {causes}, with which it is '
                f'{follows[leg]:.6g} {unit}')
        if not np.isfinite(follows).all():
            raise ParameterError(f'{source}: {name}: {follows.tolist()} {unit} from {causes}: '
                                 'must be finite')

    def _carry_payload(self, source: str) -> None:
        """Set ``carried``, and put it into the structure."""
        self.carried, payload = self.platform.body, self.payload.body
        try:
            if payload.mass > 0.0:
                self.carried = self.carried.with_body(payload)
            else:  # without effect, but it must be a body's
                self.carried.with_body(Body(0.0, self.carried.center, self.payload.inertia))
        except BodyError as exc:
            raise ParameterError(
                f'{source}: payload.inertia: {self.payload.inertia.tolist()}: {exc}'
                f'{_smallest_moment(self.payload.inertia)}') from exc
        except ParameterError as exc:
            raise ParameterError(f'{source}: payload.mass: {self.payload.mass:g} kg, with '
                                 f'platform.mass: {exc}') from exc
        (self.structure['mass'], self.structure['center_of_mass'],
         self.structure['inertia']) = self.carried
        self.structure.setflags(write=False)

    def choose_branch(self, home: Callable[[], tuple[Array, Array]]) -> None:
        """
        Set the assembly of the legs in ``structure`` that the parameters leave open.

        home: a function that returns position (3,) and rotation (3, 3) at home.
        Raises ParameterError: home does not decide it.
        """
        legs: Any = self.structure['legs'].copy()
        if self.leg_kind.choose_branch(legs, self, home):
            hexapod = self.structure.copy()
            hexapod['legs'] = legs
            hexapod.setflags(write=False)
            self.structure = hexapod

    def replaced(self, changes: Mapping[str, Any], source: str = '', *,
                 exact_types: bool = False) -> Self:
        """
        Return a copy with these values changed.

        New joints are points or on a circle, in place of the other; likewise the directions of a
        kind of legs.
        """
        dropped = without_other(changes) | without_alternatives(changes) if isinstance(
            changes, Mapping) else {}
        return super().replaced({**dropped, **changes} if dropped else changes, source,
                                exact_types=exact_types)

    def default_of(self, name: str) -> Any:
        """Return the default of a parameter, which may depend on the kind of legs."""
        return self.leg_kind.defaults.get(name, super().default_of(name))

    def unit_of(self, name: str) -> str:
        """Return the unit of a parameter, which may depend on the kind of legs."""
        return self.leg_kind.units.get(name, super().unit_of(name))

    def _only_given(self) -> tuple[str, ...]:
        """Return also the names without a meaning for the legs, or with another default."""
        return *self.described, *self.leg_kind.foreign, *self.leg_kind.defaults

    def with_points(self) -> Self:
        """Return a copy whose joints are given as points."""
        return self.replaced({f'geometry.{body}_joints': self[f'geometry.{body}_joints']
                              for body in BODIES})

    def with_payload(self, payload: Body) -> Self:
        """Return a copy with another payload."""
        return self.replaced(payload_values(payload))

    def merged(self) -> Self:
        """Return a copy without payload, whose ``platform.*`` are platform and payload."""
        if self.payload.mass == 0.0:
            return self
        mass, center, inertia = self.carried
        return self.replaced({
            'platform.mass': mass, 'platform.center_of_mass': center, 'platform.inertia': inertia,
            **dict.fromkeys(payload_values(self.payload.body))})

    def _check_drives(self, source: str) -> None:
        """Check drive.*, and set ``drives``."""
        missing = self.leg_kind.ratio and self[self.leg_kind.ratio] is None
        with np.errstate(over='ignore'):
            driven_back = 2.0 - 1.0 / self.drive.efficiency
        given = tuple(name for name in self.given
                      if name.startswith('drive.') and self[name] is not None)
        self.drives = () if missing else given
        # A whole set of parameters, as dict(parameters), gives the defaults, too.
        defaults = {'drive.back_driving_efficiency': driven_back}
        for name in given if missing else ():
            default = defaults.get(name, self.table[name].default)
            if np.size(default) == 0 or not np.all(self[name] == default):
                raise ParameterError(
                    f'{source}: {self.leg_kind.ratio}: not set: needed by {name}')
        continuous, most = self.drive.torque_continuous, self.drive.torque_max
        if continuous is not None and most is not None and np.any(continuous > most):
            raise ParameterError(
                f'{source}: drive.torque_continuous: {continuous.tolist()}: must be at most '
                f'drive.torque_max, {most.tolist()}')
        direction = self.drive.direction
        if np.any(np.abs(direction) != 1.0):
            raise ParameterError(
                f'{source}: drive.direction: {direction.tolist()}: must be 1.0 or -1.0')


PARAMETERS: Mapping[str, Parameter] = Parameters.table


def payload_values(payload: Body) -> dict[str, Any]:
    """Return the values of a payload under the names of a parameter file."""
    return {'payload.mass': payload.mass, 'payload.center_of_mass': payload.center,
            'payload.inertia': payload.inertia}


def six_of(value: Array | None, not_set: float) -> Array:
    """Return the value of each leg (6,), or one that stands for it where it is not set."""
    return np.full(6, not_set) if value is None else value


def mean_radius(points: Array) -> float:
    """Return the mean distance of points (N, 3) from their center."""
    return float(np.mean(np.linalg.norm(points - points.mean(axis=0), axis=1)))


INERTIA = 'ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'


def inertia_matrix(six: ArrayLike) -> Any:
    """Return the matrix (3, 3) of ixx ixy ixz iyy iyz izz [kg m^2]."""
    ixx, ixy, ixz, iyy, iyz, izz = np.asarray(six, dtype=float)
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def _smallest_moment(six: Array) -> str:
    moment = np.linalg.eigvalsh(inertia_matrix(six))[0]
    return (f', but its smallest principal moment is {moment:.6g} kg m^2 (the order is ixx ixy '
            'ixz iyy iyz izz)')

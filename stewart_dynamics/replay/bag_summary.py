# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The content of summary.json: its keys, their types and meanings, in the order of the file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Any

from msgspec import field
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.limits import LIMITS, limits_of_kind, POSE, Quantity
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.records import key_of, means, Number, Record, Value
from stewart_dynamics.reporting.block_statistics import ExceededLimit
from stewart_dynamics.response.response_record import RecordedResponses

VERSION = 1  # of summary.json; increased when the meaning of a key changes

When = Annotated[Number, means('when')]


def margin_key(quantity: Quantity) -> str:
    """Return the key, in a leg, of the margin of a quantity from its limits."""
    return key_of(f'{quantity.key}_margin', quantity.unit)


class Inputs(Record):
    """Where the setpoints and measurements were taken from."""

    node: Annotated[str, means('name of the node, before the topics')] = ''
    topics: Annotated[dict[str, str], means(
        'topics in the bag, by topic of the node, where the setpoints were taken from')] = {}
    differentiated_cutoff_hz: Annotated[Number, means(
        'cut-off frequency, if twist and acceleration are computed from the poses')] = None
    measured: Annotated[str | None, means('topic of the measured leg states')] = None
    measured_pose: Annotated[str | None, means(
        'topic of the achieved poses for the response')] = None
    motor_torque: Annotated[bool, means('the measured efforts are torques of the motors')] = False
    motor_current: Annotated[bool, means(
        'the measured efforts are currents of the motors')] = False


class Rejected(Record):
    """Messages or setpoints that were not answered."""

    topic: Annotated[str, means('topic of the node')]
    reason: Annotated[str, means('why they were not answered')]
    count: Annotated[int, means('number of messages or setpoints')]
    first: Annotated[str, means('details of the first of them')]
    first_at_s: Annotated[Number, means(
        'when the first of them was, by its stamp or else by its time of recording; null: not '
        'known')]


class Setpoints(Record):
    """The answered setpoints."""

    answered: Annotated[int, means('setpoints that outputs were computed for')]
    first_stamp_ns: Annotated[int | None, means('stamp of the first of them')]
    last_stamp_ns: Annotated[int | None, means('stamp of the last of them')]
    duration_s: Annotated[float, means(
        'time from the first to the last, including gaps, without jumps back')]
    gaps: Annotated[int, means('number of gaps, see above')]
    gaps_s: Annotated[float, means('time in all of them')]
    restarts: Annotated[int, means(
        'how often stamps jumped back by more than `setpoint.timeout`')]
    base_unknown: Annotated[int, means(
        "setpoints at which the base's motion is not known: they have no forces and no base "
        'wrench; 0 where `base.source` is fixed')]
    base_unknown_first_at_s: Annotated[Number, means('when the first of them was')]
    jumps: Annotated[int, means(
        'setpoints too far from the last one that was not a jump: a leg would exceed '
        '`limits.velocity_max` on the way')]
    jumps_first_at_s: Annotated[Number, means('when the first of them was')]


class LegLoads(Record):
    """Loads and motion of a leg, and its margins from limits; negative: exceeded."""

    position_min: Annotated[Number, means('shortest length')] = field(
        name='{position}_min_{position_unit}')
    position_max: Annotated[Number, means('longest length')] = field(
        name='{position}_max_{position_unit}')
    rate_peak: Annotated[Number, means('peak of the rate of the length, + extends')] = field(
        name='{rate}_peak_{rate_unit}')
    rate_peak_at: When = field(name='{rate}_peak_at_s')
    effort_peak: Annotated[Number, means('peak of the demanded force')] = field(
        name='{effort}_peak_{effort_unit}')
    effort_peak_at: When = field(name='{effort}_peak_at_s')
    effort_rms: Annotated[Number, means(
        'root of the mean over time of the demanded force squared')] = field(
        name='{effort}_rms_{effort_unit}')
    effort_published_peak: Annotated[Number, means(
        'peak of the force as published: clipped; setpoints whose force is suppressed do not '
        'count')] = field(name='{effort}_published_peak_{effort_unit}')
    power_peak_w: Annotated[Number, means(
        'peak of the power P = demanded force times rate; + drives the platform, - brakes it')]
    power_peak_at_s: When
    power_mean_w: Annotated[Number, means('mean of P over time')]
    energy_driving_j: Annotated[Number, means(
        'integral of max(P, 0): energy that the leg delivers')]
    energy_braking_j: Annotated[Number, means(
        'integral of max(-P, 0), a positive number: energy that the leg absorbs')]
    position_margin: Annotated[Number, means(
        'distance of the lengths from the nearer of `limits.length_min` and `limits.length_max`; '
        'negative: exceeded; null: no limit, or not known')] = field(
        name='{position}_margin_{position_unit}')
    rate_margin: Annotated[Number, means(
        '`limits.velocity_max` minus the magnitude of the peak rate; likewise')] = field(
        name='{rate}_margin_{rate_unit}')
    effort_margin: Annotated[Number, means(
        '`limits.force_max` minus the magnitude of the peak demanded force; likewise')] = field(
        name='{effort}_margin_{effort_unit}')

    @classmethod
    def more_fields(cls, kind: LegKind) -> Iterable[tuple[str, Any]]:
        """Return peak, time and margin of the quantities of the other limits."""
        for name in limits_of_kind(kind).legs:
            if name not in limits_of_kind(kind).usual:
                limit = LIMITS[name]
                size = 'smallest' if limit.minimum else 'largest'
                yield from zip(cls.keys_of_limit(name), (
                    Annotated[Number, means(f'{size} {limit.quantity.name}; null: not known, or '
                                            f'`{name}` is not given')], When,
                    Annotated[Number, means(f'its distance from `{name}`; negative: exceeded; '
                                            'null: likewise')]), strict=True)

    @staticmethod
    def keys_of_limit(limit: str) -> tuple[str, str, str]:
        """Return the keys of the extreme value of the quantity of a limit, its time and margin."""
        quantity, depends = LIMITS[limit].quantity, LIMITS[limit].depends
        which = 'min' if LIMITS[limit].minimum else 'max' if depends == POSE else 'peak'
        name = f'{quantity.key}_{which}'
        return key_of(name, quantity.unit), f'{name}_at_s', margin_key(quantity)

    def margin(self, quantity: Quantity) -> Number:
        """Return the margin of a quantity from its limits."""
        found: Number = self.under(margin_key(quantity))
        return found

    def peak(self, limit: str) -> tuple[Number, Number]:
        """Return the extreme value of the quantity of another limit, and when it was."""
        value, at, _ = self.keys_of_limit(limit)
        return getattr(self, value), getattr(self, at)


class MotorLoads(Record):
    """Loads of the motor of a leg."""

    torque_peak_n_m: Annotated[Number, means(
        'peak of the torque, at rest the breakaway torque')]
    torque_peak_at_s: When
    torque_rms_n_m: Annotated[Number, means('root of the mean over time of the torque squared')]
    torque_margin_n_m: Annotated[Number, means(
        'smallest distance from the torque that is available at the speed (`drive.torque_max`, '
        '`drive.torque_speed`); negative: exceeded')]
    torque_margin_at_s: When
    torque_continuous_margin_n_m: Annotated[Number, means(
        '`drive.torque_continuous` minus the RMS torque; negative: exceeded')]
    speed_peak_rad_s: Annotated[Number, means('peak of the speed, + extends')]
    speed_peak_at_s: When
    speed_mean_rad_s: Annotated[Number, means("mean over time of the speed's magnitude")]
    speed_margin_rad_s: Annotated[Number, means(
        '`drive.speed_max` minus the magnitude of the peak speed')]
    current_peak_a: Annotated[Number, means(
        'peak of the current; null without `drive.torque_constant`')]
    current_rms_a: Annotated[Number, means(
        'root of the mean over time of the current squared; likewise')]
    temperature_rise_max_k: Annotated[Number, means(
        'largest temperature of the winding above ambient, from ambient at the first setpoint; '
        'null without `drive.thermal_resistance`')]
    temperature_rise_max_at_s: When
    temperature_rise_steady_k: Annotated[Number, means(
        'where it ends if the motion is repeated without end: mean copper heat times '
        '`drive.thermal_resistance`')]
    temperature_rise_margin_k: Annotated[Number, means(
        '`drive.temperature_rise_max` minus the largest rise')]


class Bus(Record):
    """Electrical power of all motors together, on one bus."""

    power_peak_w: Annotated[Number, means('largest power drawn')]
    power_peak_at_s: When
    regenerated_peak_w: Annotated[Number, means(
        'largest power that flows back, a positive number')]
    regenerated_peak_at_s: Annotated[Number, means('when; null: never')]
    power_mean_w: Annotated[Number, means(
        'mean over time, power that flows back counted as negative')]
    energy_drawn_j: Annotated[float, means('integral of the power drawn')]
    energy_regenerated_j: Annotated[float, means('integral of the power that flows back')]
    cycles: Annotated[int, means(
        'one more than `setpoints.restarts`: a cycle lasts until the stamps jump back, as in a '
        'bag that is played in a loop; without restarts the whole bag is one')]
    energy_per_cycle_j: Annotated[float, means(
        'energy drawn less that which flows back, divided by the cycles')]


class NeededMotor(Record):
    """Smallest motor for every leg, with screw, gear and rotor of the parameters."""

    margin: Annotated[float, means('factor on the three figures below')]
    torque_continuous_n_m: Annotated[Number, means(
        'largest RMS torque of all legs times the factor')]
    torque_peak_n_m: Annotated[Number, means('largest peak torque times the factor')]
    speed_rad_s: Annotated[Number, means('largest peak speed times the factor')]


class Motors(Record):
    """Loads of the motors."""

    legs: dict[str, MotorLoads]
    bus: Annotated[Bus | None, means(
        'electrical power of all motors together, from one bus, on which a motor that brakes '
        'feeds the others; null without `drive.resistance`')]
    needed: NeededMotor


class Singularity(Record):
    """Distance of the motion from singularities."""

    determinant_nearest_m3: Annotated[Number, means(
        'det(J) where it is nearest zero at a setpoint, with its sign')]
    determinant_nearest_at_s: When
    crossings: Annotated[int, means(
        'changes of the sign of det(J), also through zero and between two setpoints; none across '
        'a restart')]
    crossings_at_s: Annotated[list[float], means(
        'when, interpolated between setpoints; the first 100')]
    condition_max: Annotated[Number, means(
        'largest condition number of J_inv, its right three columns divided by '
        '`singularity.characteristic_length`')]
    condition_max_at_s: When
    unsolved: Annotated[int, means(
        'setpoints where J_inv cannot be solved: they have no force')]
    suppressed: Annotated[int, means(
        'setpoints whose force was computed and not published: `singularity.action` or '
        '`limits.action` suppressed it')]
    time_to_crossing_min_s: Annotated[Number, means(
        'shortest time in which det(J) would have been zero at its rate; null: it never '
        'approached zero')]
    time_to_crossing_min_at_s: When
    unit_load_force_max: Annotated[Number, means(
        'largest force of any leg under a unit load on the platform: any force F and moment M '
        'with F^2 + (M / l)^2 = 1, l the characteristic length')]
    unit_load_force_leg: Annotated[str | None, means('that leg')]
    warnings: Annotated[int, means('how often the singularity warning started')]
    warnings_from_to_s: Annotated[list[tuple[float, Number]], means(
        'from the first setpoint with the warning to the first without it; null: it was still on '
        'at the end; the first 100')]
    warning_s: Annotated[float, means('time with the warning on, gaps left out')]


class SourceOfEffort(Record):
    """A part of the demanded force of a leg."""

    peak: Annotated[Number, means("peak of this part of the leg's force")] = field(
        name='peak_{effort_unit}')
    rms: Annotated[Number, means('its RMS')] = field(name='rms_{effort_unit}')


class Force(Record):
    """Statistics of a force over time."""

    rms: Annotated[Number, means('root of the mean over time of its square')] = field(name='rms_n')
    mean: Annotated[Number, means('mean over time')] = field(name='mean_n')
    peak: Annotated[Number, means('peak')] = field(name='peak_n')
    peak_at_s: When


class Moment(Record):
    """Statistics of a moment over time."""

    rms: Annotated[Number, means('root of the mean over time of its square')] = field(
        name='rms_n_m')
    mean: Annotated[Number, means('mean over time')] = field(name='mean_n_m')
    peak: Annotated[Number, means('peak')] = field(name='peak_n_m')
    peak_at_s: When


class BaseWrench(Record):
    """Wrench of the hexapod on its base: magnitudes, and components in base axes."""

    force: Force
    moment: Moment
    force_x: Force
    force_y: Force
    force_z: Force
    moment_x: Moment
    moment_y: Moment
    moment_z: Moment


LOADS_OF_WRENCH: tuple[Callable[..., Any], ...] = (*3 * (Force,), *3 * (Moment,))
"""The records of the components of a wrench."""


class ExternalWrench(Record):
    """External wrench that explains measured efforts, base axes."""

    force_x: Force
    force_y: Force
    force_z: Force
    moment_x: Moment
    moment_y: Moment
    moment_z: Moment


class Mistake(Record):
    """A possible error in the messages."""

    topic: Annotated[str, means('topic of the node')]
    text: Annotated[str, means('the contradiction, with its size and likely cause')]
    first_at_s: Annotated[Number, means('when it begins; null if stamps jumped back')]


class NotCompared(Record):
    """Setpoints that were not compared with measured efforts."""

    without_measurement: Annotated[int, means('no measured samples on both sides')]
    without_force: Annotated[int, means(
        "J_inv cannot be solved, the base's motion is not known, or a computed effort is 1e100 or "
        'more')]


class MeasuredLeg(Record):
    """Measured against computed effort of a leg."""

    residual_rms: Annotated[Number, means('RMS of the residual, over the setpoints compared')
                            ] = field(name='residual_rms_{effort_unit}')
    residual_mean: Annotated[Number, means('its mean')] = field(
        name='residual_mean_{effort_unit}')
    residual_peak: Annotated[Number, means('its peak')] = field(
        name='residual_peak_{effort_unit}')
    residual_peak_at_s: When
    measured_rms: Annotated[Number, means('RMS of the measured force')] = field(
        name='measured_rms_{effort_unit}')
    computed_rms: Annotated[Number, means('RMS of the computed force')] = field(
        name='computed_rms_{effort_unit}')
    correlation: Annotated[Number, means('correlation of measured and computed')]


class EffortsMistake(Record):
    """A possible error in measured efforts."""

    what: Annotated[str, means(
        '`sign`, `unit`, `torque`, `force`, `zero`, `swapped` or `scale`')]
    text: Annotated[str, means('the possible error')]


class Contact(Record):
    """An interval in which an external load acted on the platform."""

    from_s: Annotated[float, means('begin')]
    to_s: Annotated[float, means('end')]
    axis: Annotated[str, means('the component with the largest excess')]
    force_n: Annotated[list[float], means('largest deviation of the force from its median')]
    moment_n_m: Annotated[list[float], means('likewise of the moment')]


class Contacts(Record):
    """Intervals with an external load."""

    count: Annotated[int, means(
        'intervals in which a component of the external wrench exceeds its threshold')]
    threshold: Annotated[dict[str, float], means(
        'of each component, `force_x_n` to `moment_z_n_m`, about its median: 6 robust standard '
        "deviations, at least 0.001 of the leg forces' RMS")]
    resolution_s: Annotated[float, means('uncertainty of the times')]
    strongest: Annotated[list[Contact], means(
        'up to 100, in order of time; a load of more than half of the time is a payload')]


class Measured(Record):
    """Measured efforts against the demanded ones."""

    headline: Annotated[str, means(
        'by how much measured and computed forces differ, and in which leg most')]
    setpoints_compared: Annotated[int, means('number of setpoints compared')]
    setpoints_not_compared: NotCompared
    samples: Annotated[int, means('measured samples taken')]
    samples_out_of_order: Annotated[int, means(
        'left out, because their stamp was not later than the last one')]
    samples_jumped_back: Annotated[int, means(
        'how often their time jumped back by more than the timeout')]
    gap_limit_s: Annotated[float, means('samples farther apart are not interpolated between')]
    residual_rms: Annotated[Number, means('of the residual of all legs')] = field(
        name='residual_rms_{effort_unit}')
    residual_share: Annotated[Number, means(
        'the same by the RMS of the measured forces of all legs')]
    legs: dict[str, MeasuredLeg]
    external_wrench_given: Annotated[bool, means(
        'false where such an error, other than `scale`, makes the external wrench meaningless: '
        'its values are null, and no contacts are listed')]
    likely_mistake: Annotated[EffortsMistake | None, means('the possible error in the efforts')]
    external_wrench: ExternalWrench
    contacts: Contacts


class UncertainLeg(Record):
    """Percentiles of the magnitude of the peak force of a leg, over the hexapods."""

    effort_peak_low: Annotated[Number, means('percentile 2.5')] = field(
        name='{effort}_peak_{effort_unit}_low')
    effort_peak_median: Annotated[Number, means('percentile 50')] = field(
        name='{effort}_peak_{effort_unit}_median')
    effort_peak_high: Annotated[Number, means('percentile 97.5')] = field(
        name='{effort}_peak_{effort_unit}_high')
    effort_margin_low: Annotated[Number, means(
        '`limits.force_max` less the upper one')] = field(
        name='{effort}_margin_{effort_unit}_low')


class UncertainLimit(Record):
    """A limit of loads or motors that is given."""

    limit: Annotated[str, means('name of the parameter')]
    hexapods: Annotated[int, means('hexapods of which a leg exceeds it anywhere')]
    share: Annotated[float, means('their share')]


class Uncertainty(Record):
    """The motion on hexapods that `uncertainty.*` admits."""

    hexapods: Annotated[int, means('N')]
    legs: dict[str, UncertainLeg]
    limits: Annotated[list[UncertainLimit], means(
        'of each limit of loads or motors that is given; without temperatures')]


class BagSummary(Record, kw_only=True):
    """
    The content of summary.json.

    Keys that depend on the bag have their defaults for a motion without a bag.
    """

    version: Annotated[int, means('of these keys: 1')] = VERSION
    software: Annotated[str, means('name and version of the program that wrote the file')] = (
        SOFTWARE)
    bag: Annotated[str, means('path of the bag as it was given')] = ''
    run: Annotated[str, means('name of a run over many bags, empty for a single bag')] = ''
    complete: Annotated[bool, means('all of the bag was read')] = True
    missing: Annotated[list[str], means('what could not be read')] = []
    notices: Annotated[list[str], means(
        'what the node would log, and how the inputs were found')] = []
    inputs: Inputs = field(default_factory=Inputs)
    rejected: Annotated[list[Rejected], means(
        'messages and setpoints that were not answered, by topic and reason')] = []
    quasi_static: Annotated[bool, means(
        'the inputs are poses alone (`setpoint.source: pose` without `--differentiate`): forces '
        'are those at rest, and quantities that depend on velocities are null')]
    setpoints: Setpoints
    legs: dict[str, LegLoads]
    motors: Annotated[Motors | None, means('null where no `drive.*` is set')]
    limits: list[ExceededLimit]
    limits_not_checked: Annotated[list[str], means(
        'limits that could not be checked: `limits.velocity_max`, `drive.speed_max` and '
        '`drive.torque_speed` if only poses are known, `limits.force_max`, '
        "`limits.joint_force_max` and torques if J_inv cannot be solved or the base's motion is "
        'not known at a setpoint')]
    singularity: Singularity
    force_breakdown: Annotated[dict[str, dict[str, SourceOfEffort]] | None, means(
        'null without a report')]
    base_wrench: BaseWrench
    limit_met: Annotated[bool, means(
        'a limit was exceeded or could not be checked, a setpoint was a jump, out of reach, or '
        'had an angle outside the points of its servo, the singularity warning was on, or '
        '`mistakes` are not empty')]
    mistakes: Annotated[list[Mistake], means(
        'possible errors in the messages: twists or accelerations that are not the derivatives of '
        'poses and twists, with the size of the difference and the likeliest reason; gravity or '
        'angular velocity of the base in another unit or with another sign; stamps of arrival, of '
        'the base, of poses that are differentiated or of measured efforts')] = []
    measured: Annotated[Measured | None, means('with `--measured`, else null')] = None
    response: Annotated[RecordedResponses | None, means('with `--response`, else null')] = None
    uncertainty: Annotated[Uncertainty | None, means('with `--uncertainty`, else null')] = None
    parameters: Annotated[dict[str, Value], means(
        'all of them, as used; limits that are not checked are null')] = {}
    fingerprint: Annotated[str, means(
        'digest of files of the bag (name, size, time of modification), parameters, options, '
        'version')] = ''

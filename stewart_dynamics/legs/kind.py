# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A kind of legs: what the package asks of it.

The mechanics of a kind stand in ``core/<name>.h``. A leg has a drive, whose position, rate and
effort are numbers of a row of results; the rest of the package reads their places, their names,
and the parameters that belong to them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
import math
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import KINDS, places
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.calibrated import CalibratedLegs
from stewart_dynamics.legs.lines import AnchorCircles, Lines
from stewart_dynamics.legs.mechanism import Chain, LegJoint, MechanismBody, UNIVERSAL
from stewart_dynamics.legs.tree import LegBranch
from stewart_dynamics.possible_errors.hypothesis import PossibleError

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

STANDARD_G = 9.80665
"""Standard acceleration of free fall, in units of force [m/s^2]."""
_RESULT, _OUTPUT = places('stewart_result'), places('stewart_output')


class Named(NamedTuple):
    """A quantity of a drive."""

    name: str  # 'length'
    field: str  # of stewart_result, and the attribute of a result: 'lengths'
    unit: str
    positive: str = ''  # what a positive one does: '+ extends'
    negative: str = ''  # and a negative one: 'retracts'

    @property
    def columns(self) -> slice:
        """Return where its six numbers are in a row of results."""
        place: slice = _RESULT[self.field]
        return place


class LegMass(NamedTuple):
    """A mass or moment of each leg in which the efforts are linear."""

    name: str  # as in the names of linear parameters
    unit: str
    part: str  # of ``LegKind.bodies``
    parameter: str  # that is written where it is identified
    acts: bool = True  # efforts on a base at rest depend on it
    weighs: bool = False  # those under gravity do
    positive: bool = False  # it cannot be negative


class BaseParameter(NamedTuple):
    """A sum of masses and moments of each leg that efforts on a base at rest show alone."""

    name: str
    unit: str
    terms: Mapping[str, Array]  # coefficients (6,) by the names of linear parameters


class ZeroCause(NamedTuple):
    """A wrong zero of the measured positions, as a cause of a lack of fit."""

    what: str  # keyword for programs
    name: str
    unit: str
    factor: float  # from the unit of positions
    no_pose: str  # possible errors where no pose has the positions
    same_as: str = ''  # cause with the same forces

    @property
    def subject(self) -> str:
        """Return its name at the begin of a sentence."""
        return f'the {self.name}' if ' ' in self.name else self.name


class StopLoads(NamedTuple):
    """Loads of the drives of a hexapod, for its end stops and the steps that these need."""

    inertia: Array  # of the drives alone, at least (6,) [kg] or [kg m^2]
    carried: float  # mass of the parts that move with the platform joints [kg]
    levers: tuple[Array, Array]  # smallest and largest effort by the push on a joint (6,)
    # Largest stiffness of all stops of a leg, by the stiffness of one: at the drive (6,), and at
    # the platform joint [1/m^2].
    at_drives: Array
    at_joints: Array


class IntervalBounds(NamedTuple):
    """
    Bounds of six legs in each of N intervals, for platform joints that move in any direction.

    Each (N, 6) or (6,), for a joint with a velocity or acceleration of 1.
    """

    gains: Array  # rates of the drives
    # Relative changes of ``gains`` and of the directions of the lines, by the path of the
    # platform; and the part of it that is due to levers, both (N,) [1/m].
    bends: Array
    turning: Array
    masses: Array  # that the platform carries [kg]
    pushes: Array  # efforts by a push along the line
    efforts: Array  # efforts without a push
    ends: Array  # forces along the line without a push of the platform, at either end [kg]


class Solid(NamedTuple):
    """A cylinder of each leg, as pictures show it."""

    name: str  # in the plural: 'pistons'
    radius: float  # by the mean distance of the platform joints from their center


class Placed(NamedTuple):
    """A solid of the six legs at a pose, base frame."""

    centers: Array  # (6, 3) [m]
    directions: Array  # unit vectors (6, 3)
    lengths: Array  # (6,) [m]


class AtHome(NamedTuple):
    """A hexapod at rest in its home pose."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)
    up: Array  # unit vector from the base to the platform (3,)
    anchors: Array  # of the lines of force, the drives at the middle of their limits (6, 3) [m]
    efforts: Array | None  # of the drives, for the weight of the platform (6,); None: not known


class LegKind(ABC):
    """
    A kind of legs.

    Attributes
    ----------
    name : str
        Its name in C, in lower case.
    marker : str
        The parameter that a file gives for this kind alone; empty: the kind of all other files.
    position, rate, effort : Named
        Quantities of the drive.
    effort_signs : tuple of str
        Names of a positive effort and of a negative one.
    extremes : tuple of str
        Names of the smallest and of the largest position.
    decimals : int
        Decimals of efforts and powers in tables; -1: four digits of the largest, as torques are
        hundreds of N m or, of small servos, a few mN m.
    position_limits : tuple of str
        Limits of the drive's position, the smallest and the largest.
    rate_limit, effort_limit : str
        Limits of its rate, and of its effort, to which commands are clipped.
    period : float
        Positions of the drive that differ by it are the same; infinite: none are.
    lever_limit : str
        Limit of the smallest lever by its largest value; empty: levers do not change.
    joint_force, joint_force_limit : str
        Key of the force along the line in tables, and its limit.
    ends_differ : bool
        Whether this force differs between the ends of a leg: a result has the larger one.
    commands : str
        Field of ``stewart_output`` with the efforts to command.
    simulated : str
        Value of the simulator's parameter ``commands`` for these efforts.
    resolved : str
        Motions for which a step of the simulator is too long, besides a turn of the platform.
    exact : bool
        Whether results are sums, products, quotients and square roots, which have the same bits on
        all processors; sin, cos and atan2 depend on the mathematical library.
    width : int
        Numbers in a row of results: those of ``stewart_result`` up to the last of this kind.
    wrong_units : tuple
        Efforts in another unit, by those in the right one, and in words.
    right_sign : str
        Effect that a positive effort must have.
    gear, transmission : str
        The part between motor and drive, and all of them.
    ratio : str
        The parameter without which there are no motors; empty: not needed.
    own : tuple of str
        Parameters, or beginnings of their names, that have no meaning for other kinds.
    fields : mapping
        Fields of ``stewart_leg`` that hold parameters of this kind.
    masses : tuple of LegMass
        Masses and moments in the regressor, in the order of the columns in C.
    weights : tuple of str
        Names of masses that show by how much the masses of the legs differ from a file.
    zero_cause : ZeroCause
        The cause of a lack of fit that a wrong zero of the measured positions is.
    massless : mapping
        Values of parameters with which the legs and the drives have no mass.
    solids : tuple of Solid
        Cylinders of which pictures of a leg consist.
    parts : tuple of str
        Names of the two bodies of a leg, from the base on.
    joints : tuple of str
        Joints that carry them: UNIVERSAL, and that of the drive, SLIDE or HINGE.
    elements : tuple of str
        Parameters of this kind, in addition to its limits, that all formats of other tools have
        elements for.
    shortened : tuple of str
        Parameters that stand for several of ``elements``.
    likely : mapping
        Values of parameters that let the assembly of the legs follow from the other ones.
    zero : str
        The parameter by which the zero of the drive is chosen; empty: its joint has that zero.
    anchors_are : str
        Where the lines of force begin, in words.
    moved : str
        The part that a drive moves: 'leg'.
    moves : str
        A positive position of it: '+ extends'.
    unit_word : str
        The unit of the position, in words.
    large_effort : tuple
        An effort of the usual size, and in words.

    """

    name: str
    marker: str = ''
    position: Named
    rate: Named
    effort: Named
    effort_signs: tuple[str, str]
    extremes: tuple[str, str]
    decimals: int = 1
    position_limits: tuple[str, str]
    rate_limit: str
    effort_limit: str
    period: float = math.inf
    lever_limit: str = ''
    joint_force: str = 'joint_force'
    joint_force_limit: str
    ends_differ: bool = False
    commands: str
    simulated: str
    resolved: str
    exact: bool = True
    width: int = _RESULT['joint_forces'].stop
    right_sign: str
    gear: str
    transmission: str
    ratio: str = ''
    wrong_units: tuple[tuple[float, str], ...]
    own: tuple[str, ...]
    foreign: tuple[str, ...]  # the ``own`` of other kinds, without those of this one
    fields: Mapping[str, str]
    masses: tuple[LegMass, ...]
    weights: tuple[str, ...]
    zero_cause: ZeroCause
    massless: Mapping[str, Any]
    solids: tuple[Solid, ...]
    alternatives: tuple[tuple[str, ...], ...] = ()  # parameters, or others in their place
    units: Mapping[str, str] = {}  # of parameters, other than in the table
    defaults: Mapping[str, Any] = {}  # the same
    parts: tuple[str, str]
    joints: tuple[str, str]
    elements: tuple[str, ...]
    shortened: tuple[str, ...] = ()
    zero: str = ''
    anchors_are: str = 'base joints'
    moved: str
    moves: str
    unit_word: str
    large_effort: tuple[float, str]
    likely: Mapping[str, Any] = {}
    inertia_unit: str  # of the reflected inertia of a drive
    reflected: str  # its formula
    rotors: str  # and of which parts
    friction_units: tuple[str, str]  # viscous and Coulomb
    bodies: Mapping[str, str]  # of a leg, and the parameters of their masses

    @property
    def number(self) -> int:
        """Return ``stewart_platform.leg_kind``."""
        return KINDS[self.name.upper()]

    @property
    def stiffness_unit(self) -> str:
        """Return the unit of the stiffness of a drive."""
        return f'{self.effort.unit}/{self.position.unit}'

    @property
    def published(self) -> slice:
        """Return where the efforts to command are in a row of outputs."""
        place: slice = _OUTPUT[self.commands]
        return place

    @property
    def drive_joint(self) -> str:
        """Return the joint that the drive moves: SLIDE or HINGE."""
        return next(joint for joint in self.joints if joint != UNIVERSAL)

    @property
    def drive_limits(self) -> dict[str, str]:
        """Return the limits that formats have at the joint of a drive: fields of ``Joint``."""
        low, high = self.position_limits
        return {low: 'lower', high: 'upper', self.rate_limit: 'velocity_max',
                self.effort_limit: 'force_max'}

    def check(self, parameters: Parameters, source: str) -> None:
        """Check the rules between the parameters of this kind, and complete them."""
        del parameters, source

    @abstractmethod
    def write_fields(self, legs: Records, parameters: Parameters) -> None:
        """Write fields of ``stewart_leg`` (6,) that hold no parameter as it is given."""

    @abstractmethod
    def mass_values(self, parameters: Parameters) -> Array:
        """Return the values of ``masses`` (n, 6), SI units."""

    @abstractmethod
    def relative_changes(self, parameters: Parameters) -> Sequence[Array]:
        """
        Return how ``mass_values`` (n, 6) change with uncertain properties of a leg's parts.

        Each for a relative change of a mass, a center of mass, or an inertia.
        """

    @abstractmethod
    def with_hidden(self, parameters: Parameters, values: Array) -> Array:
        """
        Return ``mass_values`` (n, 6) with those that do not act completed by the others.

        Efforts on a base at rest determine the others alone; bodies have all of them.
        """

    @abstractmethod
    def mass_parameters(self, parameters: Parameters, values: Array) -> dict[str, Any]:
        """
        Return the parameters of bodies with ``mass_values`` (n, 6), in full.

        Raises ParameterError: no body has these.
        """

    @abstractmethod
    def mass_distances(self, parameters: Parameters) -> Array:
        """Return distances from the joints at which masses of the legs act (6,) [m]."""

    @abstractmethod
    def effort_noise(self, parameters: Parameters) -> float:
        """Return the deviation of the noise of usual measured efforts."""

    def base_parameters(self, parameters: Parameters) -> tuple[BaseParameter, ...]:
        """Return the sums that efforts on a base at rest show; empty: they are not listed."""
        del parameters
        return ()

    @abstractmethod
    def lines(self, parameters: Parameters, position: Array, rotation: Array) -> Lines:
        """Return the lines of force in poses (...); not finite where a leg does not reach."""

    def anchors(self, parameters: Parameters, positions: Array) -> Array | None:
        """
        Return where the lines of force begin (..., 6, 3), base frame [m]; None: at base joints.

        positions (..., 6): of the drives.
        """
        del parameters, positions
        return None

    def line_lengths(self, parameters: Parameters, positions: Array) -> Array:
        """Return the lengths of the lines of force (..., 6) [m] at positions of the drives."""
        del parameters
        return positions

    @abstractmethod
    def place_solids(self, parameters: Parameters, joints: Array, positions: Array,
                     ) -> tuple[Placed, ...]:
        """
        Return where the ``solids`` are.

        joints (6, 3): platform joints, base frame [m]. positions (6,): of the drives.
        """

    def anchor_circles(self, parameters: Parameters) -> AnchorCircles | None:
        """Return the circles of anchors whose lines have fixed lengths; None: they do not move."""
        del parameters
        return None

    def lever_ratios(self, parameters: Parameters, results: Array) -> Array:
        """Return levers by their largest values (..., 6); -1 where a leg does not reach."""
        del parameters
        return np.ones((*results.shape[:-1], 6))

    @abstractmethod
    def leg_mass(self, parameters: Parameters, at: Lines) -> Array:
        """Return M_i (..., 6, 3, 3) [kg], in coordinates x_i of the platform joints."""

    @abstractmethod
    def leg_coriolis(self, parameters: Parameters, at: Lines, joint_rates: Array,
                     christoffel: bool) -> Array:
        """Return C_i (..., 6, 3, 3) [kg/s] under the platform joints' velocities x_i'."""

    @abstractmethod
    def leg_gravity(self, parameters: Parameters, at: Lines) -> Array:
        """Return G_i (..., 6, 3) [N]."""

    @abstractmethod
    def base_coriolis(self, parameters: Parameters, at: Lines, spin: Array) -> Array:
        """Return what an angular velocity W (..., 3) of the base adds to C_i, a skew matrix."""

    @abstractmethod
    def base_gravity(self, parameters: Parameters, at: Lines, position: Array,
                     felt: Callable[[Array], Array], spin: Array, spin_rate: Array) -> Array:
        """
        Return G_i (..., 6, 3) [N] on a moving base.

        felt: acceleration less gravity of points (..., k, 3) at rest on the base. spin, spin_rate
        (..., 3): angular velocity and acceleration of the base.
        """

    @abstractmethod
    def calibrated_legs(self, parameters: Parameters) -> CalibratedLegs:
        """Return the numbers of the geometry that a calibration finds, and their equations."""

    def reach(self, parameters: Parameters) -> Array:
        """Return the movement of a platform joint by that of its drive, at the best (6,)."""
        del parameters
        return np.ones(6)

    def wrong_sizes(self, parameters: Parameters, anchors: Array) -> Iterator[PossibleError]:
        """
        Yield possible errors in lengths, from which others would follow.

        anchors (6, 3): see AtHome.
        """
        del parameters, anchors
        return iter(())

    def possible_errors(self, parameters: Parameters, home: AtHome) -> Iterator[PossibleError]:
        """Yield possible errors in other parameters of this kind alone."""
        del parameters, home
        return iter(())

    @abstractmethod
    def stop_loads(self, parameters: Parameters) -> StopLoads:
        """Return what the drives carry where they meet their end stops."""

    def least_levers(self, parameters: Parameters, motions: Array, ends: Array, ways: Array,
                     ) -> Array:
        """
        Return lower bounds (N, 6) of the squares of levers, by their largest ones, in intervals.

        motions, ends (N, MOTION): rows of motion at both ends of each interval.
        ways (N, 6): bounds of the ways of the platform joints between them [m].
        """
        del parameters, motions, ends
        return np.ones(ways.shape)

    @abstractmethod
    def bound_intervals(self, parameters: Parameters, results: Array, squares: Array,
                        reach: Array) -> IntervalBounds:
        """
        Return bounds in the intervals between points.

        results (N + 1, ...): rows of results at the points.
        squares (N, 6): lower bounds of the squares of levers, by their largest ones.
        reach (6,): ways of the platform joints by that of the platform.
        """

    @abstractmethod
    def nearest_fault(self, joints: Sequence[str], positions: Sequence[float],
                      ratios: Sequence[float]) -> str:
        """Return the leg that is nearest to a motion without a solution, in words."""

    @abstractmethod
    def home_rule(self, parameters: Parameters, anchors: Array) -> str:
        """Return which rule parameters break that give no home pose; anchors: see AtHome."""

    def choose_branch(self, legs: Records, parameters: Parameters,
                      home: Callable[[], tuple[Array, Array]]) -> bool:
        """
        Write which of several assemblies the legs have, and return whether any was open.

        home: a function that returns position (3,) and rotation (3, 3) at home.
        """
        return False

    @abstractmethod
    def branches(self, parameters: Parameters, position: Array, rotation: Array, mounts: Array,
                 size: float) -> list[LegBranch]:
        """
        Return the six legs at a pose at home, as branches of a tree.

        mounts: rotations (6, 3, 3) from the axes of universal joints at home, z nearly along the
            lines of force, to base axes.
        size: mean distance of the platform joints from their center, for shapes [m].
        """

    @abstractmethod
    def tree_joints(self, parameters: Parameters, mounts: Array, home: tuple[Array, Array],
                    ) -> Callable[[Array, Array], Array]:
        """
        Return the function that gives the positions of the joints of legs (..., 6, 3) [m, rad].

        It takes poses: position (..., 3) and rotation (..., 3, 3).
        home: the pose where the angles of universal joints are zero.
        """

    @abstractmethod
    def drive_of(self, steps: Sequence[LegJoint]) -> int | None:
        """Return which joint of a leg in a file is the drive; None: not a leg of this kind."""

    @abstractmethod
    def places(self, steps: Sequence[LegJoint]) -> list[str]:
        """Return where each of these joints is, in words; empty for the drive."""

    @abstractmethod
    def parting(self, steps: Sequence[LegJoint]) -> int:
        """Return which of these joints is between the bodies of its two parts."""

    @abstractmethod
    def read_leg(self, chain: Chain, base: MechanismBody, platform: MechanismBody,
                 said: list[str]) -> dict[str, Any]:
        """
        Return the parameters of a leg in a file, and 'direction', from base to platform.

        said: gets one line for each assumption.
        """

    def expanded(self, parameters: Parameters, name: str) -> Any:
        """Return the value of a parameter, of bodies as ``read_leg`` gives it for six legs."""
        return parameters[name]

    def tidy(self, values: dict[str, Any], resolution: float) -> None:
        """
        Bring parameters of six legs that were read into the shortest form.

        resolution: numbers that differ by a smaller part are equal.
        """
        del values, resolution


def check_foreign(parameters: Parameters, kind: LegKind, kinds: Sequence[LegKind],
                  source: str) -> None:
    """Raise ParameterError for a parameter that has a meaning for other kinds alone."""
    for name, value in parameters.given.items():
        default = parameters.table[name].default
        # A whole set of parameters, as dict(parameters), gives the defaults, too.
        if not name.startswith(kind.foreign) or np.size(default) > 0 and np.all(
                value == np.asarray(default)):
            continue
        unit = parameters.table[name].unit
        words = f'{source}: {name}: {shown(value)}{f" {unit}" if unit else ""}'
        if kind.marker:
            raise ParameterError(f'{words}: must not be given with {kind.marker}')
        owner = next(each for each in kinds if each is not kind and name.startswith(each.own))
        raise ParameterError(f'{words}: needs {owner.marker}, which is not set')

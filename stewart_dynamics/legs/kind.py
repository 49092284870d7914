# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A kind of legs: what the package asks of it.

The mechanics of a kind stand in ``core/<name>.h``. A leg has a drive, whose position, rate and
effort are numbers of a row of results; the rest of the package reads where they are, what they are
called, and which parameters belong to them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import KINDS, places
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.lines import Lines

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

_RESULT, _OUTPUT = places('stewart_result'), places('stewart_output')


class Named(NamedTuple):
    """A quantity of a drive."""

    name: str  # 'length'
    field: str  # of stewart_result, and the attribute of a result: 'lengths'
    unit: str
    positive: str = ''  # what a positive one does: '+ extends'

    @property
    def columns(self) -> slice:
        """Return where its six numbers are in a row of results."""
        place: slice = _RESULT[self.field]
        return place


class LegMass(NamedTuple):
    """A mass or moment of each leg in which the efforts are linear."""

    name: str  # as in the names of linear parameters
    unit: str


class HomeLegs(NamedTuple):
    """Lines from the base to the platform joints by which a home pose is found."""

    anchors: Array  # where they begin (6, 3) [m]
    shortest: Array | None  # (6,) [m]
    longest: Array | None
    length: float  # of the mean line at home [m]; 0: not known


class AtHome(NamedTuple):
    """A hexapod at rest in its home pose."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)
    up: Array  # unit vector from the base to the platform (3,)
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
    position_limits : tuple of str
        Limits of the drive's position, the smallest and the largest.
    rate_limit, effort_limit : str
        Limits of its rate, and of its effort, to which commands are clipped.
    commands : str
        Field of ``stewart_output`` with the efforts to command.
    width : int
        Numbers in a row of results: those of ``stewart_result`` up to the last of this kind.
    ratio : str
        The parameter without which there are no motors; empty: none is needed.
    own : tuple of str
        Parameters, or beginnings of their names, that have no meaning for other kinds.
    fields : mapping
        Fields of ``stewart_leg`` that hold parameters of this kind.
    masses : tuple of LegMass
        Masses and moments in the regressor, in the order of the columns in C.
    massless : mapping
        Values of parameters with which the legs and the drives have no mass.

    """

    name: str
    marker: str = ''
    position: Named
    rate: Named
    effort: Named
    position_limits: tuple[str, str]
    rate_limit: str
    effort_limit: str
    commands: str
    width: int = _RESULT['joint_forces'].stop
    ratio: str = ''
    own: tuple[str, ...]
    foreign: tuple[str, ...]  # the ``own`` of other kinds
    fields: Mapping[str, str]
    masses: tuple[LegMass, ...]
    massless: Mapping[str, Any]
    alternatives: tuple[tuple[str, ...], ...] = ()  # parameters, or others in their place
    units: Mapping[str, str] = {}  # of parameters, other than in the table
    defaults: Mapping[str, Any] = {}  # the same
    inertia_unit: str  # of the reflected inertia of a drive
    reflected: str  # what it is, in a formula
    rotors: str  # and of which parts
    friction_units: tuple[str, str]  # viscous and Coulomb

    @property
    def number(self) -> int:
        """Return ``stewart_platform.leg_kind``."""
        return KINDS[self.name.upper()]

    @property
    def published(self) -> slice:
        """Return where the efforts to command are in a row of outputs."""
        place: slice = _OUTPUT[self.commands]
        return place

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
    def lines(self, parameters: Parameters, position: Array, rotation: Array) -> Lines:
        """Return the lines of force in poses (...); not finite where a leg does not reach."""

    def missing_distances(self, parameters: Parameters, position: Array, rotation: Array,
                          ) -> Array | None:
        """Return by how much each leg misses its platform joint (..., 6) [m]; None: never."""
        del parameters, position, rotation
        return None

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

    def reach(self, parameters: Parameters) -> Array:
        """Return the movement of a platform joint by that of its drive, at the best (6,)."""
        del parameters
        return np.ones(6)

    def wrong_sizes(self, parameters: Parameters) -> Iterator[str]:
        """Yield likely mistakes in lengths, from which others would follow, each in one line."""
        del parameters
        return iter(())

    def likely_mistakes(self, parameters: Parameters, home: AtHome) -> Iterator[str]:
        """Yield likely mistakes in other parameters of this kind alone, each in one line."""
        del parameters, home
        return iter(())

    @abstractmethod
    def home_legs(self, parameters: Parameters) -> HomeLegs:
        """Return the lines by which the home pose is found."""

    @abstractmethod
    def home_rule(self, parameters: Parameters) -> str:
        """Return which rule parameters break that give no home pose."""

    def choose_branch(self, legs: Records, parameters: Parameters,
                      home: Callable[[], tuple[Array, Array]]) -> bool:
        """
        Write which of several assemblies the legs have, and return whether any was open.

        home: a function that returns position (3,) and rotation (3, 3) at home.
        """
        return False


def check_foreign(parameters: Parameters, kind: LegKind, kinds: Sequence[LegKind],
                  source: str) -> None:
    """Raise ParameterError for a parameter that has a meaning for other kinds alone."""
    for name, value in parameters.given.items():
        owner = next((each for each in kinds if each is not kind and name.startswith(each.own)),
                     None)
        default = parameters.table[name].default
        # A whole set of parameters, as dict(parameters), gives the defaults, too.
        if owner is None or np.size(default) > 0 and np.all(value == np.asarray(default)):
            continue
        unit = parameters.table[name].unit
        words = f'{source}: {name}: {shown(value)}{f" {unit}" if unit else ""}'
        if kind.marker:
            raise ParameterError(f'{words}: must not be given with {kind.marker}')
        raise ParameterError(f'{words}: needs {owner.marker}, which is not set')

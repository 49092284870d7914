# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
Base, platform and legs of a mechanism, found by how its bodies are connected.

Base and platform are the two groups of bodies that at least six joints are at; between them there
are six chains with one slide each. Names are not used, but for the block of stewart_describe.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.mechanism import (
    BALL, DescriptionError, FIXED, Joint, Mechanism, MechanismBody, SLIDE, WORLD)

LEGS = 6


class LegJoint(NamedTuple):
    """A joint of a leg, on the way from the base to the platform."""

    joint: Joint
    from_parent: bool
    """Whether its parent is the body on the side of the base."""

    @property
    def near(self) -> Array:
        """Return its point on the side of the base [m]."""
        far = self.joint.child_anchor is not None and not self.from_parent
        return self.joint.child_anchor if far and self.joint.child_anchor is not None else (
            self.joint.anchor)

    @property
    def far(self) -> Array:
        """Return its point on the side of the platform [m]."""
        far = self.joint.child_anchor is not None and self.from_parent
        return self.joint.child_anchor if far and self.joint.child_anchor is not None else (
            self.joint.anchor)


class Chain(NamedTuple):
    """A leg as found."""

    steps: list[LegJoint]
    lower: list[MechanismBody]
    """The bodies on the side of the base of its slide."""
    upper: list[MechanismBody]

    @property
    def slide(self) -> int:
        """Return which step is its slide."""
        return next(n for n, step in enumerate(self.steps) if step.joint.kind == SLIDE)


class Topology(NamedTuple):
    """The hexapod within a mechanism."""

    base: MechanismBody
    """Whose frame is the base frame."""
    platform: MechanismBody
    platform_parts: list[MechanismBody]
    """All bodies that are fixed to the platform, itself included."""
    chains: list[Chain]


class _Groups:
    """Bodies that fixed joints make one."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._of = {name: name for name in [WORLD, *mechanism.parts]}
        for joint in mechanism.joints:
            if joint.kind == FIXED:
                self._of[self.of(joint.parent)] = self.of(joint.child)
        self._members: dict[str, list[str]] = {}
        for name in self._of:
            self._members.setdefault(self.of(name), []).append(name)
        self._at: dict[str, list[Joint]] = {}
        for joint in mechanism.joints:
            ends = self.of(joint.parent), self.of(joint.child)
            if joint.kind != FIXED and ends[0] != ends[1]:
                for end in ends:
                    self._at.setdefault(end, []).append(joint)

    def of(self, name: str) -> str:
        """Return the group of a body."""
        while self._of[name] != name:
            self._of[name] = self._of[self._of[name]]  # halves the path for the next search
            name = self._of[name]
        return name

    def members(self, group: str) -> list[str]:
        """Return the bodies of a group."""
        return self._members[group]

    def at(self, group: str) -> list[Joint]:
        """Return the joints at a group."""
        return self._at.get(group, [])

    def other(self, joint: Joint, group: str) -> str:
        """Return the group at the other end of a joint."""
        parent = self.of(joint.parent)
        return self.of(joint.child) if parent == group else parent

    def reached(self, start: str, without: Iterable[str], slides: bool = True) -> set[str]:
        """Return the groups that are connected to one while others are taken away."""
        taken, found, waiting = {*without, start}, {start}, deque([start])
        while waiting:
            group = waiting.popleft()
            for joint in self.at(group):
                next_one = self.other(joint, group)
                if next_one not in taken and (slides or joint.kind != SLIDE):
                    taken.add(next_one)
                    found.add(next_one)
                    waiting.append(next_one)
        return found


def topology_of(mechanism: Mechanism) -> Topology:
    """Return the hexapod of a mechanism; DescriptionError says what there is instead."""
    slides = [joint for joint in mechanism.joints if joint.kind == SLIDE]
    groups = _Groups(mechanism)
    hubs = _hubs(mechanism, groups)
    if len(hubs) == 1 and _close(mechanism, groups, hubs[0]):
        groups = _Groups(mechanism)
        hubs = _hubs(mechanism, groups)
    if len(slides) < LEGS or len(hubs) < 2:
        raise DescriptionError(
            f'{mechanism.source}: no hexapod: {len(slides)} prismatic joints, and {len(hubs)} '
            'bodies at which six legs end; six prismatic joints are needed between two bodies, '
            f'and joints or constraints that close the loops{_hint(slides)}')
    hubs.sort(key=lambda group: _baseness(mechanism, groups, group))
    base, platform = hubs[0], hubs[1]
    chains: dict[str, Chain] = {}
    seen = {platform}
    for joint in groups.at(base):
        start = groups.other(joint, base)
        if start in seen:
            continue
        inside = groups.reached(start, (base, platform))
        seen |= inside
        chain = _chain(mechanism, groups, base, platform, inside)
        if chain is not None:
            chains[chain.steps[chain.slide].joint.name] = chain
    if len(chains) != LEGS:
        raise DescriptionError(
            f'{mechanism.source}: no hexapod: legs with one prismatic joint each between '
            f'{_shown(mechanism, groups, base)} and {_shown(mechanism, groups, platform)}: '
            f'{len(chains)}; there must be six{_open_ends(mechanism, groups)}')
    order = [name for name in mechanism.order if name in chains]
    names = order if len(order) == LEGS else [
        joint.name for joint in slides if joint.name in chains]
    parts = [mechanism.parts[name] for name in groups.members(platform)
             if name in mechanism.parts]
    return Topology(_main(mechanism, groups, base), _main(mechanism, groups, platform), parts,
                    [chains[name] for name in names])


def _hubs(mechanism: Mechanism, groups: _Groups) -> list[str]:
    return [group for group in dict.fromkeys(groups.of(name) for name in mechanism.parts)
            if len(groups.at(group)) >= LEGS]


def _open_ends(mechanism: Mechanism, groups: _Groups) -> str:
    ends = [group for group in dict.fromkeys(groups.of(name) for name in mechanism.parts)
            if len(groups.at(group)) == 1]
    return (f'. {len(ends)} bodies have one joint alone, as {_shown(mechanism, groups, ends[0])}: '
            'joints or constraints that close the loops are needed') if ends else ''


def _close(mechanism: Mechanism, groups: _Groups, base: str) -> bool:
    """
    Close the loops of a tree whose legs all begin at the base; return False for other models.

    One leg carries the platform, as in a URDF from CAD. Where all legs have as many joints, the
    last bodies of the others are fixed to it; where they have one less, they end in ball joints.
    """
    ends = []
    seen: set[str] = set()
    for joint in groups.at(base):
        start = groups.other(joint, base)
        if start in seen:
            continue
        inside = groups.reached(start, (base,))
        seen |= inside
        distances = {start: 1}
        waiting = deque([start])
        while waiting:
            group = waiting.popleft()
            for each in groups.at(group):
                other = groups.other(each, group)
                if other in inside and other not in distances:
                    distances[other] = distances[group] + 1
                    waiting.append(other)
        last, count = max(distances.items(), key=lambda item: item[1])
        slides = sum(each.kind == SLIDE for group in inside for each in groups.at(group))
        if slides == 2:  # seen from both of its bodies
            ends.append((last, count))
    if len(ends) != LEGS:
        return False
    longest = max(count for _, count in ends)
    shorter = sorted(count for _, count in ends)[0]
    if shorter == longest:
        platform = max((group for group, _ in ends),
                       key=lambda group: _mass(mechanism, groups, group))
    elif sorted(count for _, count in ends)[:-1] == [longest - 1] * (LEGS - 1):
        platform = next(group for group, count in ends if count == longest)
    else:
        return False
    kind = FIXED if shorter == longest else BALL
    for group, _ in ends:
        if group != platform:
            end = _main(mechanism, groups, group)
            mechanism.joints.append(Joint(f'{end.name} to {platform}', kind, end.name, platform,
                                          end.placement.position))
    mechanism.remarks.append(
        f'the loops are open: the ends of five legs are taken as '
        f'{"fixed to" if kind == FIXED else "ball joints on"} '
        f'{_shown(mechanism, groups, platform)} where they are in the file')
    return True


def _mass(mechanism: Mechanism, groups: _Groups, group: str) -> float:
    return sum(mechanism.parts[name].mass or 0.0 for name in groups.members(group)
               if name in mechanism.parts)


def _hint(slides: list[Joint]) -> str:
    return '' if slides else '. Cranks with rods (rotary hexapods) are not read'


def _baseness(mechanism: Mechanism, groups: _Groups, group: str) -> tuple[int, int, float]:
    """Return a key that is smallest for the base: in the world, carried by nothing, low."""
    members = groups.members(group)
    carried = any(groups.of(joint.child) == group and joint.child_anchor is None
                  for joint in groups.at(group))
    heights = [mechanism.parts[name].placement.position[2] for name in members
               if name in mechanism.parts]
    return int(WORLD not in members), int(carried), float(np.mean(heights))


def _chain(mechanism: Mechanism, groups: _Groups, base: str, platform: str, inside: set[str],
           ) -> Chain | None:
    """Return the leg that leads through these groups; None if it is not one."""
    before: dict[str, tuple[str, Joint]] = {}
    waiting = deque([base])
    while waiting and platform not in before:
        group = waiting.popleft()
        for joint in groups.at(group):
            other = groups.other(joint, group)
            through = other in inside or (other == platform and group != base)
            if through and other not in before:
                before[other] = group, joint
                waiting.append(other)
    if platform not in before:
        return None
    steps: list[LegJoint] = []
    path, group = [platform], platform
    while group != base:
        group, joint = before[group]
        steps.append(LegJoint(joint, groups.of(joint.parent) == group))
        path.append(group)
    steps.reverse()
    path.reverse()
    at = [n for n, step in enumerate(steps) if step.joint.kind == SLIDE]
    if len(at) != 1:
        return None
    lower = groups.reached(path[at[0]], (base, platform), slides=False) - {base}
    names = [name for group in inside for name in groups.members(group)]
    return Chain(steps, *([mechanism.parts[name] for name in names
                           if (groups.of(name) in lower) == side] for side in (True, False)))


def _main(mechanism: Mechanism, groups: _Groups, group: str) -> MechanismBody:
    """Return the body of a group to which its legs are attached, or else the heaviest."""
    ends = Counter(end for joint in groups.at(group) for end in (joint.parent, joint.child))
    members = [mechanism.parts[name] for name in groups.members(group) if name in mechanism.parts]
    return max(members, key=lambda part: (
        ends[part.name] > LEGS // 2, part.mass or 0.0, ends[part.name]))


def _shown(mechanism: Mechanism, groups: _Groups, group: str) -> str:
    return repr(_main(mechanism, groups, group).name)

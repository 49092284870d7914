# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Base, platform and legs of a mechanism, found by how its bodies are connected.

Base and platform are the two groups of bodies that at least six joints are at; between them there
are six chains, in which a kind of legs finds its drives. Names are not used, but for the block of
stewart_describe.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Iterable, Mapping, Sequence
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.legs import KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.legs.mechanism import (
    BALL, Chain, DescriptionError, FIXED, HINGE, Joint, LegJoint, Mechanism, MechanismBody, SLIDE,
    WORLD)

LEGS = 6
_JOINTS_OF_ROD = 2  # from the base to the end of a rod without one on the platform, at least
_ALIKE = 0.1  # masses of equal dummies, as CAD programs compute them, differ by less


class Topology(NamedTuple):
    """The hexapod within a mechanism."""

    base: MechanismBody  # whose frame is the base frame
    platform: MechanismBody
    platform_parts: list[MechanismBody]
    """All bodies that are fixed to the platform, or carried by it alone, itself included."""
    chains: list[Chain]
    kind: LegKind


class _Groups:
    """Bodies that fixed joints make one."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._parts = mechanism.parts
        self._of = {name: name for name in [WORLD, *mechanism.parts]}
        self._fixed: dict[str, list[str]] = {name: [] for name in self._of}
        for joint in mechanism.joints:
            if joint.kind == FIXED:
                self._of[self.of(joint.parent)] = self.of(joint.child)
                self._fixed[joint.parent].append(joint.child)
                self._fixed[joint.child].append(joint.parent)
        self.members: dict[str, list[str]] = {}  # names of the bodies of each group
        for name in self._of:
            self.members.setdefault(self.of(name), []).append(name)
        self.joints: dict[str, list[Joint]] = {group: [] for group in self.members}
        """Joints at each group."""
        for joint in mechanism.joints:
            ends = self.of(joint.parent), self.of(joint.child)
            if joint.kind != FIXED and ends[0] != ends[1]:
                for end in ends:
                    self.joints[end].append(joint)

    def of(self, name: str) -> str:
        """Return the group of a body."""
        while self._of[name] != name:
            self._of[name] = self._of[self._of[name]]  # halves the path for the next search
            name = self._of[name]
        return name

    def hubs(self) -> list[str]:
        """Return the groups at which six legs may end."""
        return [group for group in dict.fromkeys(map(self.of, self._parts))
                if len(self.joints[group]) >= LEGS]

    def parts(self, group: str) -> list[MechanismBody]:
        """Return the bodies of a group, without a world that is no body."""
        return [self._parts[name] for name in self.members[group] if name in self._parts]

    def main(self, group: str) -> MechanismBody:
        """
        Return the body of a group that is nearest to its joints, in fixed joints to each of them.

        It is the one to which the legs are attached, or that carries the bodies to which they are.
        Masses are not used: bodies without one may be drawn alone.
        """
        joints = Counter(end for joint in self.joints[group] for end in (
            joint.parent, joint.child) if self.of(end) == group)
        distances: Counter[str] = Counter()
        for end, count in joints.items():
            for name, distance in self.fixed_to(end).items():
                distances[name] += count * distance
        return min(self.parts(group), key=lambda part: distances[part.name])

    def fixed_to(self, start: str) -> dict[str, int]:
        """Return the bodies of a group by their number of fixed joints to one, nearest first."""
        found = {start: 0}
        waiting = deque([start])
        while waiting:
            name = waiting.popleft()
            for other in self._fixed[name]:
                if other not in found:
                    found[other] = found[name] + 1
                    waiting.append(other)
        return found

    def end(self, group: str) -> MechanismBody:
        """Return the body of a group that has its first joint."""
        joint = self.joints[group][0]
        return self._parts[joint.child if self.of(joint.child) == group else joint.parent]

    def carried(self, end: MechanismBody) -> MechanismBody:
        """Return the first body that is fixed to one and has a mass or shape, or the next one."""
        others = [self._parts[name] for name in self.fixed_to(end.name) if name in self._parts][1:]
        return next((part for part in others if part.mass or part.shapes), [*others, end][0])

    def shown(self, group: str) -> str:
        """Return the name of a group's main body, in quotes."""
        return repr(self.main(group).name)

    def other(self, joint: Joint, group: str) -> str:
        """Return the group at the other end of a joint."""
        parent = self.of(joint.parent)
        return self.of(joint.child) if parent == group else parent

    def separate(self, one: str, other: str) -> None:
        """Take the joints away that connect two groups directly, as the free joint in MJCF."""
        for group in (one, other):
            self.joints[group] = [joint for joint in self.joints[group]
                                  if self.other(joint, group) not in (one, other)]

    def reached(self, start: str, without: Iterable[str] = (), closed: Joint | None = None,
                ) -> dict[str, tuple[str, Joint] | None]:
        """
        Return the groups that are connected to one while others are taken away, nearest first.

        closed: a joint that is taken away as well.
        Each has the group and the joint that lead to it, None for the first.
        """
        found: dict[str, tuple[str, Joint] | None] = {start: None}
        waiting = deque([start])
        while waiting:
            group = waiting.popleft()
            for joint in self.joints[group]:
                other = self.other(joint, group)
                if other not in found and other not in without and joint is not closed:
                    found[other] = group, joint
                    waiting.append(other)
        return found


def topology_of(mechanism: Mechanism) -> Topology:
    """Return the hexapod of a mechanism; DescriptionError says what there is instead."""
    groups = _Groups(mechanism)
    hubs = groups.hubs()
    if len(hubs) == 1 and _close(mechanism, groups, hubs[0]):
        groups = _Groups(mechanism)
        hubs = groups.hubs()
    slides, hinges = (sum(joint.kind == kind for joint in mechanism.joints)
                      for kind in (SLIDE, HINGE))
    if slides < LEGS and hinges < LEGS or len(hubs) < 2:
        raise DescriptionError(
            f'{mechanism.source}: no hexapod: {slides} prismatic joints, and {len(hubs)} '
            'bodies at which six legs end; six prismatic joints are needed between two bodies, or '
            'six revolute ones with rods, and joints or constraints that close the loops'
            f'{_open_ends(groups) if max(slides, hinges) >= LEGS else ""}')
    base, platform = sorted(hubs, key=lambda group: _baseness(groups, group))[:2]
    groups.separate(base, platform)
    found: dict[LegKind, dict[str, Chain]] = {kind: {} for kind in KINDS}
    seen: set[str] = set()
    for joint in groups.joints[base]:
        start = groups.other(joint, base)
        if start in seen:
            continue
        inside = groups.reached(start, (base, platform))
        seen.update(inside)
        path, steps = _path(groups, base, platform, inside)
        for kind in KINDS if steps else ():
            drive = kind.drive_of(steps)
            if drive is not None:
                chain = _chain(groups, (base, platform), inside, path, steps, kind, drive)
                found[kind][chain.driven.joint.name] = chain
    kind = max(KINDS, key=lambda each: len(found[each]))
    chains = found[kind]
    if len(chains) != LEGS:
        raise DescriptionError(
            f'{mechanism.source}: no hexapod: legs with one prismatic joint each, or with one '
            f'revolute joint and a rod, between {groups.shown(base)} and '
            f'{groups.shown(platform)}: {len(chains)}; there must be six{_open_ends(groups)}')
    order = [name for name in mechanism.order if name in chains]
    names = order if len(order) == LEGS else [
        joint.name for joint in mechanism.joints if joint.name in chains]
    carried = _carried_by(groups, base, platform, seen)
    mechanism.remarks += [
        f'{part.name}: moves against the platform in the file: taken as fixed to it where it is'
        for part in carried if part.mass]
    return Topology(groups.main(base), groups.main(platform), groups.parts(platform) + carried,
                    [chains[name] for name in names], kind)


def _carried_by(groups: _Groups, base: str, platform: str, of_legs: Collection[str],
                ) -> list[MechanismBody]:
    """Return the bodies that are connected to the platform alone, by joints that move."""
    found: dict[str, None] = {}
    for joint in groups.joints[platform]:
        start = groups.other(joint, platform)
        if start in of_legs or start in found:
            continue
        others = groups.reached(start, (platform,))
        if base not in others:
            found |= dict.fromkeys(others)
    return [part for group in found for part in groups.parts(group)]


def _open_ends(groups: _Groups) -> str:
    """Return a sentence about legs that end in the air; empty without such legs."""
    ends = [group for group, joints in groups.joints.items()
            if len(joints) == 1 and groups.parts(group)]
    return (f'. {len(ends)} bodies have one joint alone, as {groups.shown(ends[0])}: the loops '
            'are open') if ends else ''


def _close(mechanism: Mechanism, groups: _Groups, base: str) -> bool:
    """
    Close the loops of a tree whose legs all begin at the base; return False for other models.

    One leg carries the platform, as in a URDF from CAD. Where all legs have as many joints, the
    last bodies of the others are fixed to it; where they have one less, they end in ball joints.
    """
    lengths: dict[str, int] = {}  # number of joints of each leg, by its last group
    seen: set[str] = set()
    for joint in groups.joints[base]:
        start = groups.other(joint, base)
        if start in seen:
            continue
        distances: dict[str, int] = {}
        for group, before in groups.reached(start, (base,)).items():
            distances[group] = distances[before[0]] + 1 if before else 1
        seen.update(distances)
        slides = sum(each.kind == SLIDE for group in distances for each in groups.joints[group])
        turns = not slides and joint.kind == HINGE and max(distances.values()) >= _JOINTS_OF_ROD
        if slides == 2 or turns:  # a slide is seen from both of its bodies
            last = max(distances, key=lambda group: distances[group])
            lengths[last] = distances[last]
    # A leg that ends at its slide has no joint at the platform.
    slide_last = sum(groups.joints[group][0].kind == SLIDE for group in lengths)
    if len(lengths) != LEGS or slide_last == LEGS:
        return False
    longest = max(lengths.values())
    shorter = Counter(lengths.values())[longest - 1]
    ends = {group: groups.end(group) for group in lengths}
    if min(lengths.values()) == longest:
        kind, how = FIXED, 'fixed to'
        platform = _odd_one(groups, ends)
        others = [end for group, end in ends.items() if group != platform]
        is_dummy = _alike(ends[platform], others)
    elif shorter == LEGS - 1:
        kind, how = BALL, 'ball joints on'
        platform = max(lengths, key=lambda group: lengths[group])
        is_dummy = not (ends[platform].shapes or ends[platform].mass)
    else:
        return False
    carrier = groups.carried(ends[platform]) if is_dummy else ends[platform]
    for group, end in ends.items():
        if group != platform:
            mechanism.joints.append(Joint(f'{end.name} to {carrier.name}', kind, end.name,
                                          carrier.name, end.placement.position))
    mechanism.remarks.append(
        f'the loops are open: the ends of five legs are taken as {how} '
        f'{carrier.name!r} where they are in the file')
    return True


def _odd_one(groups: _Groups, ends: Mapping[str, MechanismBody]) -> str:
    """Return the group at the end of a leg that is unlike the others: it has the platform."""
    values = np.array([[len(parts), sum(part.shapes for part in parts),
                        sum(part.mass or 0.0 for part in parts)]
                       for parts in map(groups.parts, ends)])
    unlike = np.abs(values - np.median(values, axis=0))
    most = unlike / np.maximum(unlike.max(axis=0), np.finfo(float).tiny)
    return [*ends][int(np.argmax(most.sum(axis=1)))]


def _alike(end: MechanismBody, others: Sequence[MechanismBody]) -> bool:
    """Return whether a body is like most of the others: the dummy of a ball joint."""
    return sum(each.shapes == end.shapes and math.isclose(
        each.mass or 0.0, end.mass or 0.0, rel_tol=_ALIKE) for each in others) > LEGS // 2


def _baseness(groups: _Groups, group: str) -> tuple[bool, bool, float]:
    """Return a key that is smallest for the base: in the world, carried by nothing, low."""
    carried = any(groups.of(joint.child) == group and joint.child_anchor is None
                  for joint in groups.joints[group])
    heights = [part.placement.position[2] for part in groups.parts(group)]
    return WORLD not in groups.members[group], carried, float(np.mean(heights))


def _path(groups: _Groups, base: str, platform: str, inside: Iterable[str],
          ) -> tuple[list[str], list[LegJoint]]:
    """Return groups and joints that lead through groups to the platform; none if none do."""
    others = set(groups.members) - {*inside, platform}
    before = groups.reached(base, others)
    if platform not in before:
        return [], []
    steps: list[LegJoint] = []
    path, group = [platform], platform
    while (step := before[group]) is not None:
        group, joint = step
        steps.insert(0, LegJoint(joint, groups.of(joint.parent) == group))
        path.insert(0, group)
    return path, steps


def _chain(groups: _Groups, ends: tuple[str, str], inside: Iterable[str], path: Sequence[str],
           steps: list[LegJoint], kind: LegKind, drive: int) -> Chain:
    """Return a leg with its bodies on both sides of the joint between its parts."""
    at = kind.parting(steps)
    reached = groups.reached(path[at], ends, steps[at].joint)
    lower, upper = ([part for group in inside if (group in reached) == is_lower
                     for part in groups.parts(group)] for is_lower in (True, False))
    return Chain(steps, drive, lower, upper, kind.places(steps))

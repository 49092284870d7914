# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Each format that is written is read as the tree that was written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from legs_of_all_kinds import KINDS, random_hexapod
import numpy as np
import pytest
from stewart_dynamics import Parameters
from stewart_dynamics.description.formats import read_mechanism, WRITERS
from stewart_dynamics.description.hexapod import Hexapod, UNLIMITED
from stewart_dynamics.description.sdf import upright
from stewart_dynamics.legs.mechanism import HERE, Placement, UNIVERSAL, WORLD

EXACT = 1e-12
SINGLE = 1e-6  # USD
NEEDS = {'xml': 'mujoco', 'usda': 'pxr'}
# Options of the tree that each format has.
TREES: dict[str, dict[str, Any]] = {
    'urdf': {'solid': False, 'unlimited': UNLIMITED}, 'sdf': {'from_home': True},
    'xml': {'uris': False, 'paired': True}, 'usda': {'uris': False, 'from_home': True}}
# Numbers of a joint that a format has no place for.
WITHOUT = {'urdf': ('armature', 'position'), 'xml': ('velocity_max',)}
NUMBERS = ('position', 'lower', 'upper', 'velocity_max', 'force_max', 'damping', 'friction',
           'armature')


def random_parameters(kind: str, seed: int) -> Parameters:
    """Return a hexapod in which some limits are not set."""
    p, _ = random_hexapod(kind, seed, 1)
    return p.replaced(dict.fromkeys((*p.leg_kind.drive_limits,)[:seed % 4]))


@pytest.mark.parametrize('suffix', WRITERS)
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(4))
def test_the_tree_that_was_written_is_read(
        suffix: str, kind: str, seed: int, tmp_path: Path) -> None:
    if suffix in NEEDS:
        pytest.importorskip(NEEDS[suffix])
    p = random_parameters(kind, seed)
    hexapod, file = Hexapod(p), tmp_path / f'hexapod.{suffix}'
    file.write_text(WRITERS[suffix](hexapod, 'hexapod'), encoding='utf-8')
    found, near = read_mechanism(file), SINGLE if suffix == 'usda' else EXACT

    def same(one: Any, other: Any) -> bool:
        scale = max(1.0, float(np.abs(other).max()))
        return bool(np.abs(np.asarray(one) - other).max() <= near * scale)

    # In SDFormat gravity is along -z of the world.
    world = HERE if suffix != 'sdf' else Placement(upright(p.gravity), np.zeros(3))
    places, joints = {WORLD: world}, {joint.name: joint for joint in found.joints}
    for body, joint, at_home, at_zero, _, leg in hexapod.tree(**TREES[suffix]):
        at = places[body.name] = places[joint.parent].of(at_zero if suffix == 'urdf' else at_home)
        read = found.parts[body.name]
        assert same(read.placement.rotation, at.rotation), body.name
        assert same(read.placement.position, at.position), body.name
        if body.mass:  # the base has any
            assert same(read.mass, body.mass) and same(read.center, body.center), body.name
            assert same(read.inertia, body.inertia), body.name
        if leg is None:
            continue
        if joint.kind == UNIVERSAL:  # two hinges in URDF and MJCF
            names = [joint.name] if joint.name in joints else leg.universal
            assert [axis for name in names for axis in joints[name].axes] == [
                pytest.approx(axis, abs=near) for axis in at.rotation.T[:2]]
            assert all(same(joints[name].anchor, at.position) for name in names)
            continue
        drive = joints[joint.name]
        assert (drive.kind, drive.parent, drive.child) == (joint.kind, joint.parent, joint.child)
        assert same(drive.axes[0], at.rotation[:, 2])
        for name in {*NUMBERS} - {*WITHOUT.get(suffix, ())}:
            one, other = getattr(drive, name), getattr(joint, name)
            assert (one is None) == (other is None), name
            assert one is None or same(one, other), name

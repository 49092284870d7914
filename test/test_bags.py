# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Finding bags, and the folders of their results."""

from __future__ import annotations

from pathlib import Path

import pytest
from snapshot import Snapshot

from stewart_dynamics import BagError
from stewart_dynamics.bags.find import find_bags, folders_of_results

PROGRAM = 'stewart_replay'


def make(folder: Path, *names: str) -> Path:
    """Make empty files: the content of a bag is not read."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return folder


def found(folder: Path, leave_out: Path | None = None) -> list[str]:
    return [bag.relative_to(folder).as_posix() for bag in find_bags(folder, leave_out)]


def results(output: Path, *paths: Path) -> dict[str, Path]:
    return {folder.relative_to(output).as_posix(): bag
            for bag, folder in folders_of_results(paths, output)}


@pytest.mark.parametrize('names', [
    ['metadata.yaml', 'x_0.mcap', 'x_1.mcap', 'other.mcap', 'deeper/metadata.yaml'],
    ['metadata.yaml'],
    # killed before it wrote metadata.yaml
    ['x.mcap'], ['x.db3'], ['x_0.mcap.zstd', 'x_1.mcap.zstd'],
    ['x_0.mcap', 'x_1.mcap', 'x_2.mcap', 'x_10.mcap']])
def test_a_bag_is_itself(tmp_path: Path, names: list[str]) -> None:
    folder = make(tmp_path / 'bag', *names)
    assert find_bags(folder) == [folder]
    assert find_bags(tmp_path) == [folder]
    assert find_bags(folder / names[0]) == [folder / names[0]]


def test_a_missing_path_is_left_to_the_reader(tmp_path: Path) -> None:
    assert find_bags(tmp_path / 'none') == [tmp_path / 'none']


def test_bags_are_found_at_any_depth_in_order(tmp_path: Path) -> None:
    make(tmp_path, 'b/metadata.yaml', 'b/x_0.mcap', 'b/inside/metadata.yaml', 'a/2/x_0.db3',
         'a/1/y/z/metadata.yaml', 'loose/one.mcap', 'loose/two.db3', 'notes.txt', 'empty/notes')
    assert found(tmp_path) == ['a/1/y/z', 'a/2', 'b', 'loose/one.mcap', 'loose/two.db3']


@pytest.mark.parametrize('names', [
    ['one.mcap', 'two.mcap'], ['x_0.mcap', 'x_0.db3'], ['x_0.mcap', 'y_1.mcap'],
    ['x.mcap', 'x_0.mcap'], ['one.mcap', 'deeper/metadata.yaml']])
def test_unrelated_files_in_a_folder_are_separate_bags(
        tmp_path: Path, names: list[str]) -> None:
    assert found(make(tmp_path, *names)) == sorted(
        name.removesuffix('/metadata.yaml') for name in names)


def test_hidden_names_and_links_are_skipped(tmp_path: Path) -> None:
    make(tmp_path / 'far', 'metadata.yaml')
    make(tmp_path / 'far' / 'file.mcap')
    near = make(tmp_path / 'near', 'bag/metadata.yaml', '.hidden/metadata.yaml', 'a/.x.mcap')
    (near / 'linked').symlink_to(tmp_path / 'far')
    (near / 'around').symlink_to(near)
    (near / 'linked.mcap').symlink_to(tmp_path / 'far' / 'metadata.yaml')
    assert found(near) == ['bag']
    # a link given by its path is followed
    (tmp_path / 'link').symlink_to(near)
    assert found(tmp_path / 'link') == ['bag']


def test_results_are_not_bags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, 'bag/metadata.yaml', 'out/x/metadata.yaml',
         'earlier/x/summary.json', 'earlier/x/bag/metadata.yaml', 'earlier/x/bag/bag.mcap')
    assert found(tmp_path, tmp_path / 'out') == ['bag']
    monkeypatch.chdir(tmp_path / 'bag')
    assert found(tmp_path, Path('..', 'out')) == ['bag']
    # unless given by their path
    assert find_bags(tmp_path / 'earlier' / 'x' / 'bag') == [tmp_path / 'earlier' / 'x' / 'bag']


def test_a_folder_without_bags_is_an_error(tmp_path: Path, snapshot: Snapshot) -> None:
    make(tmp_path, 'notes.txt', '.hidden/metadata.yaml', 'old.bag.active')
    with snapshot.raises(BagError) as caught:
        find_bags(tmp_path)
    assert f'{caught.value}'.startswith(f'{tmp_path}: ')
    assert '\n' not in f'{caught.value}'


def test_bags_of_ros_1_are_found(tmp_path: Path) -> None:
    make(tmp_path, 'a/old_0.bag', 'a/old_1.bag', 'b/one.bag', 'b/two.bag')
    # files that are numbered are one recording
    assert find_bags(tmp_path) == [tmp_path / 'a', tmp_path / 'b/one.bag', tmp_path / 'b/two.bag']


def test_results_are_where_the_bags_are(tmp_path: Path) -> None:
    bags = make(tmp_path / 'bags', 'day/1/metadata.yaml', 'day/2/x.mcap', 'day/3/p.mcap',
                'day/3/q.v2.mcap', 'night/metadata.yaml')
    output = tmp_path / 'out'
    assert results(output, bags) == {
        'day/1': bags / 'day/1', 'day/2': bags / 'day/2', 'day/3/p': bags / 'day/3/p.mcap',
        'day/3/q.v2': bags / 'day/3/q.v2.mcap', 'night': bags / 'night'}
    assert results(output, bags / 'night', bags / 'day/3/p.mcap', bags / 'day/2') == {
        'night': bags / 'night', 'p': bags / 'day/3/p.mcap', '2': bags / 'day/2'}


def test_a_bag_that_is_the_working_folder_has_a_name(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(make(tmp_path / 'bag', 'metadata.yaml'))
    assert folders_of_results([Path('.')], Path('out')) == [(Path('.'), Path('out', 'bag'))]


def test_files_keep_their_suffix_if_names_would_be_equal(tmp_path: Path) -> None:
    bags = make(tmp_path / 'bags', 'a.mcap', 'a.db3', 'b.mcap', 'c.mcap', 'c/metadata.yaml',
                'd.mcap', 'd/deeper/metadata.yaml')
    assert results(tmp_path, bags) == {
        'a.mcap': bags / 'a.mcap', 'a.db3': bags / 'a.db3', 'b': bags / 'b.mcap',
        'c.mcap': bags / 'c.mcap', 'c': bags / 'c', 'd.mcap': bags / 'd.mcap',
        'd/deeper': bags / 'd/deeper'}


def test_results_in_the_same_folder_are_rejected(tmp_path: Path, snapshot: Snapshot) -> None:
    make(tmp_path, 'one/x/metadata.yaml', 'one/y/metadata.yaml', 'two/x/metadata.yaml',
         'three/a/x/in/metadata.yaml', 'three/a/y/metadata.yaml', 'index.html/metadata.yaml')
    output = tmp_path / 'out'
    for paths in ([tmp_path / 'one', tmp_path / 'two' / 'x'],
                  [tmp_path / 'one' / 'x', tmp_path / 'one' / 'x'],
                  [tmp_path / 'one' / 'x', tmp_path / 'one' / '..' / 'one' / 'x']):
        with snapshot.raises(BagError):
            folders_of_results(paths, output)
    with snapshot.raises(BagError):
        folders_of_results([tmp_path / 'three' / 'a', tmp_path / 'two'], output)
    with snapshot.raises(BagError):
        folders_of_results([tmp_path / 'index.html', tmp_path / 'one' / 'x'], output)

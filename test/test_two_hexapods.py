# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Two nodes in one domain, as two_hexapods.launch.py starts them: neither hears the other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from rclpy.serialization import deserialize_message
from running import executable, HOME, own_domain, Peer, Program, ROOT
from sensor_msgs.msg import JointState
from stewart_dynamics import Parameters, StewartPlatform

pytestmark = [pytest.mark.ros, pytest.mark.slow]

NAMES = 'left', 'right'
FILE = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
HEXAPODS = {'left': FILE, 'right': FILE.replaced({
    'platform.mass': 250.0, 'limits.velocity_max': 0.4})}


@pytest.fixture
def both(ros_environment: None, tmp_path: Path) -> Iterator[tuple[Peer, dict[str, Program]]]:
    """Return a participant, and the nodes by their namespaces."""
    with own_domain() as domain:
        peer, programs = Peer(domain), {}
        try:
            for name, parameters in HEXAPODS.items():
                file = tmp_path / f'{name}.yaml'
                parameters.to_yaml(file)
                programs[name] = Program([
                    executable('stewart_dynamics'), '--ros-args', '-r', f'__ns:=/{name}',
                    '--params-file', file, '-p', f'base_frame:={name}_base',
                    '-p', f'platform_frame:={name}_platform'], domain, tmp_path / name)
            yield peer, programs
            for program in programs.values():
                assert program.stop() == 0, program.stderr
        finally:
            for program in programs.values():
                if not program.ended:
                    program.stop()
            peer.close()


def test_each_answers_its_own_setpoints_alone(both: tuple[Peer, dict[str, Program]]) -> None:
    peer, _ = both
    topics = {name: f'/{name}/stewart_dynamics' for name in NAMES}
    states = {name: peer.listen(f'{topics[name]}/leg_states', JointState) for name in NAMES}
    diagnostics = peer.listen('/diagnostics', DiagnosticArray)
    messages: dict[str, Any] = HOME.messages(1_000_000_000, 'left_base')
    writers = {(name, topic): peer.writer(f'{topics[name]}/{topic}', type(message))
               for name in NAMES for topic, message in messages.items()}
    peer.until(lambda: all(each.get_subscription_count() for each in writers.values())
               and all(peer.node.count_publishers(f'{each}/leg_states')
                       for each in topics.values()), 'both nodes are there')

    def send(name: str, seconds: int, frame: str) -> None:
        for topic, message in HOME.messages(seconds * 1_000_000_000, frame).items():
            writers[name, topic].publish(message)

    for seconds, name in enumerate(NAMES, 1):
        send(name, seconds, f'{name}_base')
        peer.until(lambda name=name: states[name], f'{name} answers')  # type: ignore[misc]
        state = deserialize_message(states[name][-1], JointState)
        expected = StewartPlatform(HEXAPODS[name]).inverse_dynamics(HOME.motion())
        assert list(state.effort) == expected.forces.tolist()
    assert [len(each) for each in states.values()] == [1, 1]
    # A setpoint in the frame of the other hexapod is rejected, and named.
    send('right', 10, 'left_base')

    def rejected() -> bool:
        return any(status.name == 'right/stewart_dynamics: setpoints'
                   and any('frame' in pair.key and pair.value not in ('', '0')
                           for pair in status.values)
                   for each in diagnostics
                   for status in deserialize_message(each, DiagnosticArray).status)

    peer.until(rejected, 'the rejection is counted')
    assert len(states['right']) == 1
    names = {status.name.partition(':')[0] for each in diagnostics
             for status in deserialize_message(each, DiagnosticArray).status}
    assert names == {f'{name}/stewart_dynamics' for name in NAMES}

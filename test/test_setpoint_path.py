# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The path of a setpoint through the node: its files, backlogs and restarts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
import sys
from types import FrameType
from typing import Any
from unittest.mock import patch

from checked_results import state_record
import pytest

pytest.importorskip('rclpy', reason='the node needs ROS')

import rclpy  # noqa: E402
from rclpy.experimental.events_executor import EventsExecutor  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from referees import ROOT  # noqa: E402
from running import HOME, nanoseconds, Peer, PLATFORM, QOS, raw, Sample, SEPARATE  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
import stewart_dynamics  # noqa: E402
from stewart_dynamics.node.dynamics_node import BACKLOG, DynamicsNode  # noqa: E402
from stewart_dynamics.setpoints.rejections import DROPPED, OUT_OF_RANGE, Rejection  # noqa: E402

PACKAGE = Path(stewart_dynamics.__file__).parent
BEGIN = 1_700_000_000_000_000_000  # a stamp [ns]
MOST_FILES = 12


class Fed:
    """A node that nothing spins: messages are passed to its callback, answers come by topic."""

    def __init__(self, domain: int, *arguments: str) -> None:
        with patch.object(sys, 'argv', [
                'inside', '--ros-args', '--params-file', str(PLATFORM), *arguments]):
            rclpy.init(args=sys.argv, domain_id=domain)
            self.node = DynamicsNode()
        self.executor = EventsExecutor()
        self.executor.add_node(self.node)
        self.peer = Peer(domain)
        self.states = self.peer.listen('/stewart_dynamics/leg_states', JointState, QOS)
        publisher = self.node._topics.publishers['leg_states']
        self.peer.until(lambda: publisher.get_subscription_count() == 1, 'the node is matched')

    def close(self) -> None:
        """Leave ROS."""
        self.peer.close()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()

    def send(self, *stamps: int, sample: Sample = HOME) -> None:
        """Let setpoints come, one message each."""
        for stamp in stamps:
            self.node._on_setpoint('setpoint/combined', raw(sample.combined(BEGIN + stamp)))

    def gather(self, *stamps: int, sample: Sample = HOME) -> None:
        """Let setpoints come while the node gathers them."""
        self.node._gathering = True
        self.send(*stamps, sample=sample)

    def answered(self, number: int) -> list[int]:
        """Return the stamps of the answers, once there are ``number``."""
        self.peer.until(lambda: len(self.states) >= number, f'{number} answers')
        return [nanoseconds(deserialize_message(each, JointState).header.stamp) - BEGIN
                for each in self.states]

    @property
    def counts(self) -> dict[Rejection, int]:
        """Return the counts of rejections."""
        return dict(self.node._setpoints.counts)


@pytest.fixture
def fed(domain: int) -> Iterator[Fed]:
    """Return a node that takes combined setpoints."""
    each = Fed(domain, '-p', 'setpoint.source:=combined')
    yield each
    each.close()


def test_a_backlog_is_answered_in_order_until_it_is_too_long(fed: Fed) -> None:
    fed.send(0)
    fed.gather(*range(1, BACKLOG + 1))
    assert fed.answered(1) == [0]
    fed.node._answer_waiting()
    assert fed.answered(BACKLOG + 1) == list(range(BACKLOG + 1))
    assert not fed.counts
    fed.gather(*range(200, 201 + BACKLOG))
    fed.node._answer_waiting()
    assert fed.answered(BACKLOG + 2)[BACKLOG + 1:] == [200 + BACKLOG]
    assert fed.counts == {Rejection('setpoint', DROPPED): BACKLOG}


def test_a_restart_that_is_dropped_or_cannot_be_answered_holds_for_the_next(fed: Fed) -> None:
    day = 86400 * 1_000_000_000
    too_large = Sample(position=(1e200, 0.0, 1.1))
    fed.send(3 * day)
    fed.gather(2 * day, *range(2 * day + 1, 2 * day + 1 + BACKLOG))
    fed.node._answer_waiting()
    fed.answered(2)
    outputs = fed.node._diagnostics.answers.outputs
    assert outputs is not None
    assert outputs.stamps[0] == BEGIN + 2 * day + BACKLOG
    assert outputs.singularity().crossings == 0
    fed.gather(day, sample=too_large)
    fed.node._answer_waiting()
    assert fed.counts[Rejection('setpoint', OUT_OF_RANGE)] == 1
    assert state_record(fed.node._setpoints.last_outputs().state)['restarting']
    fed.gather(day + 1)
    fed.node._answer_waiting()
    assert fed.answered(3)[2] == day + 1
    assert not state_record(fed.node._setpoints.last_outputs().state)['restarting']


def test_the_page_names_the_files_that_a_setpoint_runs_through(domain: int) -> None:
    page = (ROOT / 'docs' / 'development.md').read_text(encoding='utf-8')
    section = page.partition('## Path of a setpoint')[2].partition('\n## ')[0]
    on_page = re.findall(r'^\| `([\w/]+\.(?:py|c))` \|', section, flags=re.MULTILINE)
    each = Fed(domain)
    try:
        found = traced(each)
    finally:
        each.close()
    # These call functions in C, which no profile sees.
    for called in ('stewart_dynamics.c', 'setpoints.c', 'messages.c', 'joining.c'):
        found.insert(found.index('setpoints/input_stream.py') + 1, f'core/{called}')
    assert on_page == found
    assert len(found) <= MOST_FILES


def traced(fed: Fed) -> list[str]:
    """Return the package's files that a setpoint runs through, until it is published."""
    found: list[str] = []

    def note(frame: FrameType, event: str, argument: Any) -> None:
        path = Path(frame.f_code.co_filename)
        if event != 'call' or not path.is_relative_to(PACKAGE):
            return
        if frame.f_code.co_name == '_note':  # all is published
            sys.setprofile(None)
        name = path.relative_to(PACKAGE).as_posix()
        if name not in found:
            found.append(name)

    for n in range(2):
        messages = HOME.messages(BEGIN + n)
        for topic in SEPARATE:
            data = raw(messages[topic])
            sys.setprofile(note if n else None)
            try:
                fed.node._on_setpoint(topic, data)
            finally:
                sys.setprofile(None)
    fed.answered(2)
    return found

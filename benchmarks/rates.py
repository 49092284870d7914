# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Where the node ends: setpoints at 1 to 8 kHz, and for three nodes on one computer.

Run by hand, ``make bench-node``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
import gc
import os
import sys
import tempfile
from threading import Thread
import time
from typing import Any

from inverse_dynamics import markdown, processor_name, write
from latency import FIRST_STAMP, messages, PERIOD, QOS, REPEATED, wait_for
from node import DOMAIN, ours, Process, SETTLE, SHARED_MEMORY
import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory

BEGIN, END = '<!-- rates: begin -->', '<!-- rates: end -->'
CASES = ((1000, 1), (2000, 1), (4000, 1), (6000, 1), (8000, 1), (1000, 3), (2000, 3))
SECONDS = 10


def publish(names: list[str], rate: int, seconds: int) -> None:
    """Publish combined setpoints for all nodes at a rate, and say how many came in time."""
    node = rclpy.create_node('setpoint_source')
    publishers = [node.create_publisher(
        MultiDOFJointTrajectory, f'/{name}/setpoint/combined', QOS) for name in names]
    wait_for(lambda: all(each.get_subscription_count() for each in publishers),
             'every node hears it')
    content = messages('combined')
    print('ready', flush=True)
    sys.stdin.readline()
    gc.disable()
    begin, step = time.monotonic_ns(), 1_000_000_000 // rate
    late = 0
    for n in range(seconds * rate):
        due = begin + n * step
        while (left := due - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        late += time.monotonic_ns() - due > step
        sec, nanosec = divmod(FIRST_STAMP + n * PERIOD, 1_000_000_000)
        data = (b'\x00\x01\x00\x00' + sec.to_bytes(4, 'little') + nanosec.to_bytes(4, 'little')
                + content[n % REPEATED][0][12:])
        for publisher in publishers:
            publisher.publish(data)
    print(f'{late} {time.monotonic_ns() - begin}', flush=True)


def listen(names: list[str]) -> None:
    """Count the leg states of each node until a signal, and say the counts."""
    node = rclpy.create_node('listener')
    counts = dict.fromkeys(names, 0)

    def count(name: str) -> Any:
        def heard(data: bytes) -> None:
            counts[name] += 1

        return heard

    for name in names:
        node.create_subscription(JointState, f'/{name}/leg_states', count(name), QOS, raw=True)
    wait_for(lambda: all(node.count_publishers(f'/{name}/leg_states') for name in names),
             'it hears every node')
    print('ready', flush=True)
    executor = EventsExecutor()
    executor.add_node(node)
    end = Future()
    Thread(target=lambda: end.set_result(sys.stdin.readline()), daemon=True).start()
    while not end.done():
        executor.spin_until_future_complete(end, 0.5)
    print(' '.join(str(counts[name]) for name in names), flush=True)
    os._exit(0)


def measure(rate: int, many: int) -> tuple[str, ...]:
    """Return a row of the table."""
    names = [f'hexapod_{n}' for n in range(many)]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        common = {'ROS_DOMAIN_ID': DOMAIN, 'ROS_LOG_DIR': folder, **SHARED_MEMORY.node}

        def start(*command: str) -> Process:
            process = Process(command, common)
            stack.callback(process.stop)
            return process

        nodes = [start(*ours(name, 'combined').command) for name in names]
        listener = start(sys.executable, __file__, 'listen', *names)
        source = start(sys.executable, __file__, 'publish', str(rate), *names)
        listener.expect('ready')
        source.expect('ready')
        time.sleep(SETTLE)
        before, begin = [node.processor for node in nodes], time.monotonic()
        source.go()
        assert source.process.stdout is not None
        late, taken = source.process.stdout.readline().split()
        cores = [(node.processor - processor) / (time.monotonic() - begin)
                 for node, processor in zip(nodes, before, strict=True)]
        time.sleep(1.0)
        listener.go()
        assert listener.process.stdout is not None
        answered = [int(each) for each in listener.process.stdout.readline().split()]
    sent = rate * SECONDS
    return (f'{rate:,} Hz', str(many), f'{sent / (int(taken) * 1e-9):,.0f} Hz',
            f'{int(late) / sent:.1%}', ', '.join(f'{1.0 - each / sent:.2%}' for each in answered),
            ', '.join(f'{each:.0%}' for each in cores))


def main() -> None:
    """Measure and print, or be one of the processes around the nodes."""
    if sys.argv[1:2] == ['publish']:
        rclpy.init(args=[])
        publish(sys.argv[3:], int(sys.argv[2]), SECONDS)
        return
    if sys.argv[1:2] == ['listen']:
        rclpy.init(args=[])
        listen(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--write', action='store_true', help='put the table into results/')
    options = parser.parse_args()
    cells = [('setpoints', 'nodes', 'published at', 'late by a period', 'lost', 'of a core'),
             *(measure(rate, many) for rate, many in CASES)]
    lines = ['', *markdown(cells), '', f'{processor_name()}, {len(os.sched_getaffinity(0))} '
             f'cores. {SECONDS} s each.', '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()

# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The transports of Fast DDS: the programs of this package use UDP, and no shared memory.

When a process joins, as each ROS command does, Fast DDS opens its queue in shared memory. If the
thread that reads this queue is busy at that moment, Fast DDS sleeps for 333 ms and looks again,
with the lock of the publisher held whose subscriber has joined: ``publish`` waits, and with it the
loop (SharedMemGlobal::Port::healthy_check, called by StatefulWriter::matched_reader_add in 2.14).
A stopped or killed subscriber may hold a lock there for seconds. Over UDP none of this happens, at
equal latency (benchmarks/README.md).
"""

from __future__ import annotations

import os
from pathlib import Path

from stewart_dynamics.ros.security import (
    BUILTIN_TRANSPORTS, DEFAULT_FILES, PROFILE_VARIABLES, PROFILES, RANGE, WIDE_RANGES)

# UDP on 127.0.0.1 alone.
ONE_HOST = Path(__file__).with_name('one_host.xml')


def leave_shared_memory() -> None:
    """
    Choose transports by variables of this process, before ``rclpy.init``; never those of the user.

    The variables and files by which a user chooses transports are left as they are:
    ``FASTDDS_BUILTIN_TRANSPORTS=DEFAULT`` is UDP and shared memory. For the range LOCALHOST, to
    which ROS itself adds shared memory whatever that variable says, it is a profile with the same
    reach. Another middleware ignores all of this.
    """
    given = (*PROFILE_VARIABLES, BUILTIN_TRANSPORTS, 'ROS_STATIC_PEERS')
    if any(os.environ.get(name) for name in given) or any(map(os.path.exists, DEFAULT_FILES)):
        return
    if os.environ.get(RANGE, '') in WIDE_RANGES and os.environ.get('ROS_LOCALHOST_ONLY') != '1':
        os.environ[BUILTIN_TRANSPORTS] = 'UDPv4'
        return
    os.environ[PROFILES] = str(ONE_HOST)
    os.environ[RANGE] = 'SYSTEM_DEFAULT'
    os.environ.pop('ROS_LOCALHOST_ONLY', None)

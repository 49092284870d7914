# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Start, spinning and exit codes of the nodes."""

from __future__ import annotations

from collections.abc import Callable
import sys
from typing import Any
import warnings

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import NameValidationException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.parameters.parameter_set import ParameterSet
from stewart_dynamics.ros.console_scripts import parameter_files
from stewart_dynamics.ros.rclpy_workarounds import reject_impossible_times, shut_down, spin
from stewart_dynamics.ros.security import check_environment, without_security_libraries
from stewart_dynamics.ros.signal_flag import SIGNALS
from stewart_dynamics.ros.transports import leave_shared_memory

# Errors that the user can correct: reported in one line. All others are defects of this package.
_OF_THE_USER = (StewartError, RCLError, NameValidationException)


def run(make_node: Callable[[], Node], kind: type[ParameterSet],
        done: Future | None = None) -> int:
    """
    Make a node, spin it until a signal or ``done`` stops it, and return the exit code.

    make_node: called after rclpy.init; a StewartError that it raises is printed in one line, exit
        code 1.
    kind: its parameters; their files have been checked by ``console_scripts``.
    done: when it is done, its result is the exit code.
    """
    SIGNALS.watch()
    executor = node = None
    try:
        if parameter_files(sys.argv) and '--ros-args' not in sys.argv:
            raise ParameterError('--params-file is only read after --ros-args')
        for stray in remove_ros_args(sys.argv)[1:]:
            raise ParameterError(f'{stray}: unknown argument; see --help')
        warning = check_environment(sys.argv)
        leave_shared_memory()
        reject_impossible_times()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        logger = get_logger(kind.node)

        def show(message: Warning | str, *_: Any, **__: Any) -> None:
            logger.warning(str(message))

        warnings.showwarning = show
        with without_security_libraries():
            node = make_node()
        if warning:
            node.get_logger().warning(warning)
        # The single-threaded one takes 2.5 times the processor time, most of it for building its
        # wait set anew for every message (https://github.com/ros2/rclpy/issues/1389), and answers
        # a backlog one message after the other.
        executor = EventsExecutor()
        executor.add_node(node)
        stop = done or Future()
        spin(executor, node, stop, lambda: SIGNALS.received)
        return stop.result() or 0
    except KeyboardInterrupt:
        return 0
    except UnknownROSArgsError as exc:
        print(f'{kind.node}: {str(exc).strip("[]")}: unknown after --ros-args; see --help',
              file=sys.stderr)
        return 1
    except _OF_THE_USER as exc:
        print(f'{kind.node}: {" ".join(str(exc).split())}', file=sys.stderr)
        return 1
    finally:
        SIGNALS.ignore()
        shut_down(executor, node)

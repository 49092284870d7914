# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The lifecycle of a node: start, transitions, and parameters that change meanwhile."""

from __future__ import annotations

from abc import abstractmethod
import gc
from typing import Generic, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.yaml_file import is_of_ros
from stewart_dynamics.ros.declared_parameters import (
    changed, declare_parameters, log_changes, MADE_WITH)
from stewart_dynamics.ros.rclpy_workarounds import answer_impossible_transitions
from stewart_dynamics.ros.repeated_log import ERROR, RepeatedLog

Kind = TypeVar('Kind', bound=Parameters)


class ManagedNode(LifecycleNode, Generic[Kind]):
    """
    A node with a lifecycle; a subclass opens and closes its topics, and begins and ends its work.

    Its constructor ends with ``start``.

    Raises ParameterError if the parameters break a rule: then nothing starts.
    """

    def __init__(self, kind: type[Kind]) -> None:
        super().__init__(kind.node, **MADE_WITH)
        self._settings: Kind = declare_parameters(self, kind)
        self._log = RepeatedLog(self.get_logger())
        self._active = self._configured = self._starting = False
        self.add_on_set_parameters_callback(self._on_set_parameters)
        answer_impossible_transitions(self, lambda text: self._log.write([(ERROR, text, text)]))

    def start(self) -> None:
        """Configure and activate the node if ``autostart`` is set."""
        if not self._settings.autostart:
            self.get_logger().info('unconfigured: autostart is false')
            return
        self._starting = True
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise StewartError(f'cannot be configured: {self._fault}')
        self._starting = False
        self.trigger_activate()

    # -- what a node does -------------------------------------------------------------------

    @abstractmethod
    def open_topics(self) -> None:
        """Make the models and open the topics."""

    @abstractmethod
    def begin_work(self) -> None:
        """Begin to work; earlier messages are not used."""

    @abstractmethod
    def end_work(self) -> None:
        """End the work of an active node."""

    @abstractmethod
    def close_topics(self) -> None:
        """Close the topics, also where not all are open."""

    @abstractmethod
    def use_parameters(self, parameters: Kind) -> None:
        """Use changed parameters from now on, or raise ParameterError and change nothing."""

    # -- transitions ------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the topics."""
        try:
            for error in find_parameter_errors(self._settings):
                self.get_logger().warning(error)
            self.open_topics()
        except Exception as exc:
            # rclpy turns an exception in a transition into ERROR and logs nothing.
            self._fault = ' '.join(f'{type(exc).__name__}: {exc}'.split())
            if not self._starting:  # else the program ends with this text
                self.get_logger().error(f'cannot be configured: {self._fault}')
            self.close_topics()
            return TransitionCallbackReturn.FAILURE
        self._configured = True
        keep_present_objects()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work."""
        self.begin_work()
        self._active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work."""
        self._deactivate()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the topics."""
        self._configured = False
        self.close_topics()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work and close the topics."""
        self._deactivate()
        return self.on_cleanup(state)

    def destroy_node(self) -> None:
        """End the work, log the last line of each series, and end."""
        self._deactivate()
        super().destroy_node()

    def _deactivate(self) -> None:
        active, self._active = self._active, False
        if active:
            self.end_work()
        self._log.write_last()

    # -- parameters -------------------------------------------------------------------------

    def _on_set_parameters(self, changes: list[RosParameter]) -> SetParametersResult:
        """Change all of these parameters between two messages, or reject all."""
        ours = {change.name: change.value for change in changes if not is_of_ros(change.name)}
        try:
            parameters = changed(self._settings, ours, self._configured)
            self.use_parameters(parameters)
        except ParameterError as exc:
            return SetParametersResult(
                successful=False, reason=str(exc).removeprefix('parameters: '))
        self._log.write(log_changes(self._settings, parameters))
        self._settings = parameters
        return SetParametersResult(successful=True)


def keep_present_objects() -> None:
    """
    Keep the objects that exist now from the collector, until the next call.

    It would go through all of them again and again, for 50 ms and more, while a setpoint waits.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()

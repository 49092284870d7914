# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: the motion of a car or aircraft in a game, for stewart_cueing. Copy what you need.

It receives the UDP packets of a game and publishes sensor_msgs/Imu on /stewart_cueing/vehicle:

  outsim     Live for Speed, OutSim (cfg.txt: OutSim Mode 1, Delay 1, IP, Port; OutSim Opts 0), and
             programs that send the same 64 or 68 bytes
  xplane11   X-Plane 9 to 11, data output 4 (Mach, VVI, g-load) and 16 (angular velocities), 60 Hz
  xplane12   X-Plane 12: the same, where angular velocities are roll, pitch, yaw in deg/s

Packets have no stamp of a clock that others know: they get the time at which they come. OutSim has
accelerations without gravity in axes of the world, X-Plane has specific forces in g. Packets with
other numbers than a game has, and those that are older than the last, are counted and dropped.

It hears games on this computer. For a game on another one, --address is the address of this
computer in the network of the game: then everybody there can move the hexapod.
Its options follow the format: --port 4123 --address 192.168.1.10.
"""

import argparse
import math
import socket
import struct
import sys

import numpy as np
from stewart_dynamics.messages.received import checked_numbers, ReceivedError

GRAVITY = 9.80665
# The axes of a game, by how each of forward, left and up is made of them: (axis, sign).
OUTSIM_AXES = ((1, 1.0), (0, -1.0), (2, 1.0))  # x right, y forward, z up
XPLANE_AXES = ((0, 1.0), (1, -1.0), (2, -1.0))  # x forward, y right, z down
_OUTSIM = struct.Struct('<I12f3i')
_XPLANE_ROW = struct.Struct('<i8f')
_G_LOAD, _ANGULAR_VELOCITY = 4, 16
LARGEST = 1e4  # of any number that is used, in the units of the game


def to_vehicle(vector, axes, axial=False):
    """
    Return a vector in x forward, y left, z up.

    Where the axes of the game are left-handed, axial vectors as the angular velocity have the
    other sign: there a positive rotation is clockwise about its axis.
    """
    matrix = np.zeros((3, 3))
    for row, (column, sign) in enumerate(axes):
        matrix[row, column] = sign
    return (np.linalg.det(matrix) if axial else 1.0) * matrix @ np.asarray(vector, dtype=float)


def outsim_rotation(heading, pitch, roll):
    """Return car axes to world axes, both x right, y forward, z up: all anticlockwise."""
    ch, sh, cp, sp, cr, sr = (f(angle) for angle in (heading, pitch, roll)
                              for f in (math.cos, math.sin))
    about_z = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    about_y = np.array([[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]])
    return about_z @ about_x @ about_y


class OutSim:
    """Reads OutSim: acceleration without gravity and angular velocity in axes of the world."""

    def __init__(self):
        self._last = None

    def read(self, packet):
        """Return specific force [m/s^2] and angular velocity [rad/s]; None: an old packet."""
        if len(packet) not in (_OUTSIM.size, _OUTSIM.size + 4):
            raise ReceivedError(f'{len(packet)} bytes: must be {_OUTSIM.size}, or with an ID '
                                f'{_OUTSIM.size + 4} (OutSim Opts must be 0)')
        milliseconds, *numbers = _OUTSIM.unpack_from(packet)
        turning, angles, acceleration = np.reshape(
            checked_numbers('OutSim', numbers[:9], 9, LARGEST), (3, 3))
        # A game that is restarted begins at zero again.
        if self._last is not None and 0 < self._last - milliseconds < 1000:
            return None
        self._last = milliseconds
        to_car = outsim_rotation(*angles).T
        force = to_car @ (acceleration + [0.0, 0.0, GRAVITY])
        return (to_vehicle(force, OUTSIM_AXES),
                to_vehicle(to_car @ turning, OUTSIM_AXES, axial=True))


class XPlane:
    """Reads X-Plane's DATA: g-load and angular velocities, which may come in two packets."""

    def __init__(self, version):
        self._twelve = version >= 12
        self._turning = np.zeros(3)

    def read(self, packet):
        """Return specific force [m/s^2] and angular velocity [rad/s]; None: no g-load in it."""
        rows, left = divmod(len(packet) - 5, _XPLANE_ROW.size)
        if packet[:4] != b'DATA' or rows < 1 or left:
            raise ReceivedError(f'{len(packet)} bytes, begins with {packet[:4]!r}: must be DATA '
                                'and rows of 36 bytes')
        force = None
        for n in range(rows):
            index, *values = _XPLANE_ROW.unpack_from(packet, 5 + n * _XPLANE_ROW.size)
            if index == _ANGULAR_VELOCITY:
                a, b, c = checked_numbers('angular velocities', values[:3], 3, LARGEST)
                # roll, pitch, yaw [deg/s]; before, pitch, roll, yaw [rad/s]
                self._turning = np.radians([a, b, c]) if self._twelve else np.array([b, a, c])
            elif index == _G_LOAD:
                normal, axial, side = checked_numbers('g-load', values[4:7], 3, LARGEST)
                force = GRAVITY * np.array([axial, side, -normal])
        if force is None:
            return None
        return (to_vehicle(force, XPLANE_AXES),
                to_vehicle(self._turning, XPLANE_AXES, axial=True))


FORMATS = {'outsim': OutSim, 'xplane11': lambda: XPlane(11), 'xplane12': lambda: XPlane(12)}


def run(options):
    """Publish until stopped."""
    import rclpy
    from sensor_msgs.msg import Imu

    node = rclpy.create_node('game_telemetry')
    publisher = node.create_publisher(Imu, '/stewart_cueing/vehicle', 100)
    reader, message, dropped = FORMATS[options.format](), Imu(), 0
    message.header.frame_id = 'head'
    message.orientation_covariance[0] = -1.0  # not measured
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind((options.address, options.port))
        receiver.settimeout(0.5)  # to look whether it is stopped
        node.get_logger().info(
            f'{options.format} on {options.address}:{receiver.getsockname()[1]}')
        while rclpy.ok():
            try:
                found = reader.read(receiver.recv(65535))
                if found is None:
                    continue
            except TimeoutError:
                continue
            except ReceivedError as exc:
                dropped += 1
                if dropped == 1 or dropped % 1000 == 0:
                    node.get_logger().warning(f'packet dropped ({dropped} so far): {exc}')
                continue
            force, turning = (vector.tolist() for vector in found)
            message.header.stamp = node.get_clock().now().to_msg()
            acceleration, rate = message.linear_acceleration, message.angular_velocity
            acceleration.x, acceleration.y, acceleration.z = force
            rate.x, rate.y, rate.z = turning
            publisher.publish(message)


def main():
    import rclpy
    from rclpy.utilities import remove_ros_args
    from stewart_dynamics.ros.transports import leave_shared_memory

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('format', choices=FORMATS)
    parser.add_argument('--port', type=int, default=4123, help='UDP port (default: %(default)s)')
    parser.add_argument('--address', default='127.0.0.1',
                        help='address of this computer on which games are heard; 0.0.0.0: all of '
                        'them (default: %(default)s, games on this computer)')
    if {'-h', '--help'} & set(sys.argv[1:]):
        parser.parse_args(['--help'])
    # A process that joins could make publish() wait for a third of a second.
    leave_shared_memory()
    try:
        rclpy.init()
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'game_telemetry: {exc}')
    try:
        run(parser.parse_args(remove_ros_args(sys.argv)[1:]))
    except (OSError, OverflowError) as exc:  # address or port
        sys.exit(f'game_telemetry: {exc}')
    except (KeyboardInterrupt, rclpy._rclpy_pybind11.RCLError):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()

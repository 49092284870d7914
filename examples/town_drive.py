# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: a drive through town, as an IMU at the driver's head measures it. Copy what you need.

The car starts from a traffic light, turns right, passes a roundabout and a speed bump, brakes for
a pedestrian and stops at the next light: its speed and the curvature of its path over time are in
LEGS below. It publishes sensor_msgs/Imu on /stewart_cueing/vehicle; --csv FILE writes the same
numbers for stewart_cueing_report, and needs no ROS.
"""

import argparse
from pathlib import Path
import sys
import time

import numpy as np

GRAVITY = 9.80665
RATE = 100.0  # [Hz]
# From each time [s] on: speed [m/s], and curvature of the path, + to the left [1/m].
LEGS = np.array([
    [0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [10.0, 13.0, 0.0], [17.0, 13.0, 0.0],
    [21.0, 6.0, 0.0], [23.0, 6.0, -0.10], [25.5, 6.0, -0.10], [27.0, 8.0, 0.0],
    [32.0, 13.0, 0.0], [36.0, 13.0, 0.0], [39.5, 6.5, 0.0], [41.0, 6.5, -0.06],
    [43.0, 6.5, 0.07], [49.0, 6.5, 0.07], [51.0, 6.5, -0.06], [53.0, 7.5, 0.0],
    [58.0, 13.0, 0.0], [63.0, 13.0, 0.0], [66.0, 5.0, 0.0], [68.5, 5.0, 0.0],
    [73.0, 13.0, 0.0], [76.0, 13.0, 0.0], [78.2, 2.0, 0.0], [80.0, 2.0, 0.0],
    [85.0, 11.0, 0.0], [92.0, 11.0, 0.0], [97.0, 0.0, 0.0], [104.0, 0.0, 0.0]])
BUMP, BUMP_HEIGHT, BUMP_LENGTH = 67.0, 0.06, 3.0  # [s], [m], [m]
DURATION = float(LEGS[-1, 0])
_SMOOTH = 0.6  # of the driver's hands and feet [s]
_ROLL, _PITCH = 0.006, 0.005  # of the body on its springs [rad / (m/s^2)]
_ROUGHNESS = 0.12  # of the road at 10 m/s [m/s^2]


def drive() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (N,) [s], specific forces (N, 3) [m/s^2], angular velocities (N, 3) [rad/s]."""
    times = np.arange(round(DURATION * RATE) + 1) / RATE
    width = round(_SMOOTH * RATE)
    window = np.hanning(width + 2)[1:-1] / np.hanning(width + 2).sum()

    def smooth(column: int) -> np.ndarray:
        values = np.interp(times, LEGS[:, 0], LEGS[:, column])
        padded = np.pad(values, (width // 2, width - 1 - width // 2), mode='edge')
        return np.convolve(padded, window, mode='valid')

    speed, curvature = np.maximum(smooth(1), 0.0), smooth(2)
    forward, left = np.gradient(speed, times), speed ** 2 * curvature
    # The bump, under the front and the rear axle, and the road.
    way = np.concatenate([[0.0], np.cumsum(speed[1:] + speed[:-1]) / (2.0 * RATE)])
    begin = np.interp(BUMP, times, way)
    height = np.zeros(len(times))
    for axle in (0.0, 2.7):
        u = np.clip((way - begin - axle) / BUMP_LENGTH, 0.0, 1.0)
        height += 0.5 * BUMP_HEIGHT * np.sin(np.pi * u) ** 2
    up = np.gradient(np.gradient(height, times), times)
    noise = np.random.default_rng(7).normal(size=len(times) + 8)
    up += _ROUGHNESS * speed / 10.0 * np.convolve(noise, np.ones(9) / 3.0, mode='valid')
    roll, pitch = _ROLL * left, -_PITCH * forward
    forces = np.column_stack([
        forward - GRAVITY * np.sin(pitch), left + GRAVITY * np.sin(roll), GRAVITY + up])
    rates = np.column_stack([
        np.gradient(roll, times), np.gradient(pitch, times), speed * curvature])
    return times, forces, rates


def write_csv(path: Path) -> None:
    """Write the drive as columns."""
    header = 't [s],ax [m/s^2],ay [m/s^2],az [m/s^2],wx [rad/s],wy [rad/s],wz [rad/s]'
    np.savetxt(path, np.column_stack(drive()), fmt='%.9g', delimiter=',', header=header,
               comments='')


def publish(parser: argparse.ArgumentParser) -> None:
    """Publish the drive, again and again."""
    import rclpy
    from rclpy.utilities import remove_ros_args
    from sensor_msgs.msg import Imu
    from stewart_dynamics.ros.transports import leave_shared_memory

    # A process that joins could make publish() wait for a third of a second.
    leave_shared_memory()
    try:
        rclpy.init()
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'town_drive: {exc}')
    parser.parse_args(remove_ros_args(sys.argv)[1:])
    node = rclpy.create_node('town_drive')
    publisher = node.create_publisher(Imu, '/stewart_cueing/vehicle', 100)
    times, forces, rates = drive()
    message = Imu()
    message.header.frame_id = 'driver'
    message.orientation_covariance[0] = -1.0  # not measured
    index, begun = 0, time.monotonic()
    try:
        while rclpy.ok():
            if index == len(times):
                index, begun = 0, time.monotonic()
            time.sleep(max(begun + times[index] - time.monotonic(), 0.0))
            message.header.stamp = node.get_clock().now().to_msg()
            acceleration, turning = message.linear_acceleration, message.angular_velocity
            acceleration.x, acceleration.y, acceleration.z = forces[index].tolist()
            turning.x, turning.y, turning.z = rates[index].tolist()
            publisher.publish(message)
            index += 1
    except (KeyboardInterrupt, rclpy._rclpy_pybind11.RCLError):
        pass
    finally:
        rclpy.try_shutdown()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--csv', type=Path, metavar='FILE', help='write the drive and end')
    options, _ = parser.parse_known_args()
    if options.csv:
        write_csv(options.csv)
    else:
        publish(parser)


if __name__ == '__main__':
    main()

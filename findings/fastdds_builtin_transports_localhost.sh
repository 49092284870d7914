#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# With ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST rmw_fastrtps of Jazzy adds shared memory to a node,
# whatever FASTDDS_BUILTIN_TRANSPORTS is: UDPv4, which removes it with the range SUBNET, has no effect.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check \
  'ros-rclpy[fastrtps]==7.1.6' ros-rmw-fastrtps-cpp==8.4.3 ros-fastrtps==2.14.5 ros-jazzy-common-interfaces==5.3.6 2>&1 |
  grep -v '^WARNING' || true
cat > node.py <<'PY'
import os

import rclpy
rclpy.init()
node = rclpy.create_node('alone')
maps = open('/proc/self/maps').read()
print(os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE'), os.environ.get('FASTDDS_BUILTIN_TRANSPORTS'),
      'shared memory' if '/dev/shm/fastrtps' in maps else 'no shared memory', flush=True)
os._exit(0)
PY
unset FASTRTPS_DEFAULT_PROFILES_FILE FASTDDS_BUILTIN_TRANSPORTS ROS_LOCALHOST_ONLY ROS_STATIC_PEERS
export ROS_DOMAIN_ID=97 ROS_LOG_DIR=$folder/log
venv/bin/python -m pip list 2> /dev/null | grep -E '^ros-(rclpy|rmw-fastrtps-cpp|fastrtps) '
for range in SUBNET LOCALHOST; do
  for transports in DEFAULT UDPv4; do
    ROS_AUTOMATIC_DISCOVERY_RANGE=$range FASTDDS_BUILTIN_TRANSPORTS=$transports venv/bin/python node.py
  done
done | tee seen
diff - seen <<'END'
SUBNET DEFAULT shared memory
SUBNET UDPv4 no shared memory
LOCALHOST DEFAULT shared memory
LOCALHOST UDPv4 shared memory
END

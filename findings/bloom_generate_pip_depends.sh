#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# bloom-generate rosdebian, with which a ROS package becomes a .deb of one's own, accepts a dependency that
# rosdep has for pip alone: it writes the name of PyPI into Depends, and ends with 0. No package of Debian
# has this name, or another one has it, and only apt says so when the .deb is installed. bloom-release
# rejects such a key, in a check that bloom-generate leaves out.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check bloom==0.14.4 rosdep==0.27.0 2>&1 |
  grep -v '^WARNING' || true
export HOME=$folder ROS_HOME=$folder ROSDEP_SOURCE_PATH=$folder ROSDISTRO_INDEX_URL=file://$folder/index.yaml
export PATH=$folder/venv/bin:$PATH
echo "yaml file://$folder/keys.yaml" > 20-keys.list
echo 'python3-rosbags-pip: {ubuntu: {pip: {packages: [rosbags]}}}' > keys.yaml  # as in rosdistro
cat > index.yaml <<'YAML'
type: index
version: 4
distributions:
  jazzy:
    distribution: [distribution.yaml]
    distribution_status: active
    distribution_type: ros2
    python_version: 3
YAML
cat > distribution.yaml <<'YAML'
type: distribution
version: 2
release_platforms: {ubuntu: [noble]}
repositories: {}
YAML
mkdir package
cat > package/package.xml <<'XML'
<?xml version="1.0"?>
<package format="3">
  <name>reader</name>
  <version>1.0.0</version>
  <description>Reads bags.</description>
  <maintainer email="nobody@example.org">nobody</maintainer>
  <license>Apache-2.0</license>
  <exec_depend>python3-rosbags-pip</exec_depend>
  <export><build_type>ament_python</build_type></export>
</package>
XML
git init -q package
rosdep update > updated 2>&1 || { cat updated; exit 1; }
rosdep resolve python3-rosbags-pip --os ubuntu:noble --rosdistro jazzy
cd package
bloom-generate rosdebian --ros-distro jazzy --os-name ubuntu --os-version noble > ../generated 2>&1 || {
  cat ../generated; exit 1; }
grep '^Depends:' debian/control
grep -q '^Depends:.*[ ,]rosbags' debian/control
grep -q pip debian/control && { echo 'Depends says that it is of pip'; exit 1; }
echo 'bloom-generate made the name of PyPI a package of Debian, and ended with 0'

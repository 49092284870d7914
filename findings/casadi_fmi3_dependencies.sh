#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# CasADi rejects the description of an FMU of FMI 3.0 whose ModelStructure has no attributes
# "dependencies". They are optional there (Model Structure): left out, an output depends on all
# its knowns. With them the same description is read.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.2.6 2>&1 |
  grep -v '^WARNING' || true
mkdir without with
cat > without/modelDescription.xml <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="decay" instantiationToken="{1}">
  <ModelExchange modelIdentifier="decay"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="x" valueReference="1" causality="output" variability="continuous" start="1"
      initial="exact"/>
    <Float64 name="der(x)" valueReference="2" causality="local" variability="continuous"
      derivative="1" initial="calculated"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/>
    <ContinuousStateDerivative valueReference="2"/>
    <InitialUnknown valueReference="2"/>
  </ModelStructure>
</fmiModelDescription>
XML
sed 's|\(valueReference="[12]"\)/>$|\1 dependencies="1"/>|' without/modelDescription.xml > with/modelDescription.xml
cat > read.py <<'PY'
import os
import sys

import casadi
try:
    found = casadi.DaeBuilder('decay', os.path.abspath(sys.argv[1]))
    print(sys.argv[1], 'dependencies: read, states', found.x(), 'outputs', found.y())
except RuntimeError as exc:
    print(sys.argv[1], 'dependencies:', str(exc).strip().splitlines()[-1])
PY
venv/bin/python -c 'import casadi; print("casadi", casadi.__version__)'
for each in without with; do venv/bin/python read.py $each 2>&1 | tail -1; done | tee found
diff - found <<'SEEN'
without dependencies: Default 'dependencies' not implemented
with dependencies: read, states ['x'] outputs ['x']
SEEN

#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# FMPy steps an FMU for co-simulation at more than the step_size that it is given: without
# output_interval it doubles the step until there are at most 1000, and step_size and the
# DefaultExperiment of the FMU do not count. The FMU here has one output, the size of the last step.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check fmpy==0.3.32 numpy==2.2.6 2>&1 |
  grep -v '^WARNING' || true
mkdir -p fmu/binaries/linux64
cat > fmu/modelDescription.xml <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="clock" guid="{1}">
  <CoSimulation modelIdentifier="clock" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stepSize="0.001"/>
  <ModelVariables>
    <ScalarVariable name="size" valueReference="0" causality="output" variability="continuous">
      <Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/></Outputs>
    <InitialUnknowns><Unknown index="1"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
XML
cat > clock.c <<'C'
#include <stddef.h>
static double size;
static int instance;
const char * fmi2GetTypesPlatform(void) {return "default";}
const char * fmi2GetVersion(void) {return "2.0";}
void * fmi2Instantiate(const char * n, int t, const char * g, const char * r, const void * f, int v,
  int l) {return &instance;}
void fmi2FreeInstance(void * c) {}
int fmi2DoStep(void * c, double time, double step, int prior) {size = step; return 0;}
int fmi2GetReal(void * c, const unsigned r[], size_t n, double v[])
{
  for (size_t k = 0; k < n; k++) {v[k] = size;}
  return 0;
}
#define OK(name) int name(void * c) {return 0;}
OK(fmi2SetDebugLogging) OK(fmi2SetupExperiment) OK(fmi2EnterInitializationMode)
OK(fmi2ExitInitializationMode) OK(fmi2Terminate) OK(fmi2Reset) OK(fmi2GetInteger)
OK(fmi2GetBoolean) OK(fmi2GetString) OK(fmi2SetReal) OK(fmi2SetInteger) OK(fmi2SetBoolean)
OK(fmi2SetString) OK(fmi2GetFMUstate) OK(fmi2SetFMUstate) OK(fmi2FreeFMUstate)
OK(fmi2SerializedFMUstateSize) OK(fmi2SerializeFMUstate) OK(fmi2DeSerializeFMUstate)
OK(fmi2GetDirectionalDerivative) OK(fmi2SetRealInputDerivatives) OK(fmi2GetRealOutputDerivatives)
OK(fmi2CancelStep) OK(fmi2GetStatus) OK(fmi2GetRealStatus) OK(fmi2GetIntegerStatus)
OK(fmi2GetBooleanStatus) OK(fmi2GetStringStatus)
C
gcc -w -shared -fPIC clock.c -o fmu/binaries/linux64/clock.so
cat > steps.py <<'PY'
import os

import fmpy

print('fmpy', fmpy.__version__, 'over 4 s:')
for given in ({}, {'step_size': 0.001}, {'output_interval': 0.001}):
    rows = fmpy.simulate_fmu(os.path.abspath('fmu'), stop_time=4.0, validate=False, **given)
    print(given, 'steps of', round(float(rows['size'][-1]), 9), 's')
PY
venv/bin/python steps.py | tee found
diff - found <<'SEEN'
fmpy 0.3.32 over 4 s:
{} steps of 0.004 s
{'step_size': 0.001} steps of 0.004 s
{'output_interval': 0.001} steps of 0.001 s
SEEN

#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# Units and signs of the Python package dynamixel-sdk. Its model files have one scale of currents for
# servos whose e-Manual says 2.69 mA (XM430) and 1 mA (XL330), a torque with the unit N/m for others,
# and 4096 increments a turn for the XL-320, whose e-Manual has 1024 for 300 degrees. Its 4095 is
# half a turn on one side of the middle, as 0 is on the other: 2047 increments for as much as 2048.
# A register of two's complement is read without its sign: -5 is written, and 65531 comes back.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check dynamixel-sdk==4.1.0 2>&1 |
  grep -v '^WARNING' || true
cat > units.py <<'PY'
from importlib.metadata import version
from pathlib import Path

import dynamixel_easy_sdk
from dynamixel_sdk import PacketHandler

print('dynamixel-sdk', version('dynamixel-sdk'))
MODELS = Path(dynamixel_easy_sdk.__file__).parent / 'control_table'


def rows(model):
    """Return the lines of a model file before its control table, by their first words."""
    head = (MODELS / f'{model}.model').read_text().partition('[control table]')[0]
    return {line.split('\t')[0]: line.split('\t')[1:] for line in head.splitlines() if line}


for model in ('xm430_w350', 'xl330_m288', 'xc330_t181', 'xh540_w150'):
    value, unit, *_ = rows(model)['Present Current']
    print(f'{model}: Present Current {float(value):.5g} {unit}')
for model in ('xm430_w350', 'xl320'):
    zero, most = (int(rows(model)[f'value_of_{end}_radian_position'][0])
                  for end in ('zero', 'max'))
    radians = float(rows(model)['max_radian'][0])
    print(f'{model}: {zero} to {most}: {most - zero} increments for {radians:.5f} rad')


class Port:
    """A port to a servo that keeps what is written, and answers with it."""

    is_using = False
    memory = b''
    answer = b''

    def clearPort(self):
        """Do nothing."""

    def setPacketTimeout(self, *_):
        """Do nothing."""

    setPacketTimeoutMillis = setPacketTimeout

    def isPacketTimeout(self):
        return not self.answer

    def writePort(self, packet):
        """Take a packet: write of two bytes, or read; put the answer together."""
        handler = PacketHandler(2.0)
        data = b''
        if packet[7] == 3:
            self.memory = bytes(packet[10:12])
        else:
            data = self.memory
        body = bytes([0xff, 0xff, 0xfd, 0, 1, 4 + len(data), 0, 0x55, 0]) + data
        crc = handler.updateCRC(0, body, len(body))
        self.answer = body + crc.to_bytes(2, 'little')
        return len(packet)

    def readPort(self, length):
        """Return bytes of the answer."""
        data, self.answer = self.answer[:length], self.answer[length:]
        return data


port, handler = Port(), PacketHandler(2.0)
print('written: -5, result', *handler.write2ByteTxRx(port, 1, 102, -5)[:1])
value, result, _ = handler.read2ByteTxRx(port, 1, 102)
print('read:', value, 'result', result)
PY
venv/bin/python units.py | tee found
diff - found <<'SEEN'
dynamixel-sdk 4.1.0
xm430_w350: Present Current 1 raw
xl330_m288: Present Current 1 raw
xc330_t181: Present Current 0.00067095 N/m
xh540_w150: Present Current 0.0045 N/m
xm430_w350: 2048 to 4095: 2047 increments for 3.14159 rad
xl320: 2048 to 4095: 2047 increments for 3.14159 rad
written: -5, result 0
read: 65531 result 0
SEEN

/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Runs a sketch until its input has ended and nothing has been printed for 10 s of its time.
 */

#include "Arduino.h"

SerialPort Serial;

void setup();
void loop();

int main()
{
  setup();
  for (int n = 0; n < 10000; n++) {
    if (Serial.available()) {
      n = 0;
    }
    loop();
  }
  return 0;
}

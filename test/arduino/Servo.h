/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A servo of the exported sketch on this computer: prints what it is commanded.
 */

#ifndef SERVO_H
#define SERVO_H

#include <cstdio>

class Servo
{
public:
  void attach(int pin, int least, int most)
  {
    pin_ = pin;
    std::printf("servo %d %d %d\n", pin, least, most);
  }
  bool attached() const {return pin_ >= 0;}
  void writeMicroseconds(int pulse) {std::printf("pulse %d %d\n", pin_, pulse);}

private:
  int pin_ = -1;
};

#endif

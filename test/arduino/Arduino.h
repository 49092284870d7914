/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the exported sketch takes from Arduino, for this computer: the serial port is that of the
 * program, and time goes on by a millisecond whenever it is read.
 */

#ifndef ARDUINO_H
#define ARDUINO_H

#include <cstddef>
#include <cstdio>

inline unsigned long & clock_of_sketch() {static unsigned long time = 0; return time;}
inline unsigned long millis() {return clock_of_sketch()++;}
inline unsigned long micros() {return 1000 * clock_of_sketch();}

struct SerialPort
{
  int next = std::getchar();
  void begin(long) {}
  int available() const {return next == EOF ? 0 : 1;}
  int read() {const int given = next; next = std::getchar(); return given;}
  void print(const char * text) {std::fputs(text, stdout);}
  void print(double value, int digits) {std::printf("%.*f", digits, value);}
  void print(unsigned long value) {std::printf("%lu", value);}
  void println() {std::puts("");}
  void println(const char * text) {std::puts(text);}
  void println(int value) {std::printf("%d\n", value);}
  void println(unsigned long value) {std::printf("%lu\n", value);}
};

extern SerialPort Serial;

#endif

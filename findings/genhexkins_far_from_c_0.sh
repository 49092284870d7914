#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# genhexkins, the kinematics of LinuxCNC for hexapods, finds no pose where the platform is turned
# far about z. The joints are those of its own inverse kinematics at a pose with its own default
# geometry; the forward kinematics begins 0.01 units beside that pose. It adds the change of the
# pose as a small rotation to A, B and C. Written for Debian 12, whose module is loaded here into a
# program that has the few functions of HAL that it calls.
set -euo pipefail
version='2.9.0~pre1+git20230208.f1270d6ed7-1+deb12u2'
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get -o APT::Sandbox::User=root download "linuxcnc-uspace=$version" >/dev/null
dpkg -x linuxcnc-uspace_*.deb package
cat > program.c <<'C'
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

/* HAL: a pin is a number of its own. */
int hal_init(const char * name) {return 1;}
int hal_ready(int id) {return 0;}
int hal_exit(int id) {return 0;}
void * hal_malloc(long size) {return calloc(1, (size_t)size);}
static int pin(void ** place) {*place = calloc(1, sizeof(double)); return 0;}
int hal_pin_float_newf(int d, void ** p, int id, const char * f, ...) {return pin(p);}
int hal_pin_u32_newf(int d, void ** p, int id, const char * f, ...) {return pin(p);}
int hal_pin_bit_newf(int d, void ** p, int id, const char * f, ...) {return pin(p);}
int hal_pin_bit_new(const char * n, int d, void ** p, int id) {return pin(p);}
int hal_pin_s32_new(const char * n, int d, void ** p, int id) {return pin(p);}
void rtapi_print(const char * f, ...) {}
void rtapi_print_msg(int level, const char * f, ...) {}

typedef struct {double x, y, z, a, b, c, u, v, w;} pose;
typedef int (* forward)(const double *, pose *, const unsigned long *, unsigned long *);
typedef int (* inverse)(const pose *, double *, const unsigned long *, unsigned long *);

int main(int argc, char ** argv)
{
  static const double turns[] = {0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0};
  void * module = dlopen(argv[1], RTLD_NOW);
  int (* start)(void) = (int (*)(void))dlsym(module, "rtapi_app_main");
  forward to_pose = (forward)dlsym(module, "kinematicsForward");
  inverse to_joints = (inverse)dlsym(module, "kinematicsInverse");
  unsigned long f = 0, i = 0;
  if (start()) {return 2;}
  for (size_t n = 0; n < sizeof turns / sizeof *turns; n++) {
    pose target = {0.1, 0.1, 20.0, 0.0, 0.0, turns[n], 0.0, 0.0, 0.0}, found = target;
    double joints[16] = {0.0};
    if (to_joints(&target, joints, &i, &f)) {return 2;}
    if (n == 0) {to_pose(joints, &found, &f, &i);}  /* the first call begins at a pose of its own */
    found = target;
    found.x += 0.01;
    int code = to_pose(joints, &found, &f, &i);
    printf("C = %2.0f degrees: %s\n", turns[n], code ? "no pose" :
      found.x - target.x < 1e-6 && target.x - found.x < 1e-6 ? "the pose" : "another pose");
  }
  return 0;
}
C
gcc -w -rdynamic program.c -o program -ldl
echo "linuxcnc-uspace $version, genhexkins, forward kinematics from 0.01 units beside the pose:"
./program package/usr/lib/linuxcnc/modules/genhexkins.so | tee found
diff - found <<'SEEN'
C =  0 degrees: the pose
C = 15 degrees: the pose
C = 30 degrees: the pose
C = 45 degrees: the pose
C = 60 degrees: no pose
C = 75 degrees: no pose
C = 90 degrees: no pose
SEEN

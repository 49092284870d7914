/* SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The exported C source as a function of Octave and MATLAB (MEX):
 *
 *   [forces, lengths, status] = stewart_forces(position, rotation, twist, acceleration, payload)
 *
 * position (3), rotation (3 x 3), twist (6) and acceleration (6): of the platform, base axes; the
 * last two may be empty: zero. payload (10, or left out): mass, center of mass, inertia ixx ixy
 * ixz iyy iyz izz. status is a code of stewart_dynamics.h, 0: valid; otherwise forces are zero.
 *
 * In Octave, with the files that stewart_export has written to exported/:
 *
 *   mkoctfile --mex -DHEXAPOD=hexapod -Iexported stewart_forces.c exported/hexapod.c ...
 *     exported/stewart_dynamics.c
 */

#include <mex.h>

#include <string.h>

#include "stewart_dynamics.h"

extern const stewart_platform HEXAPOD;

/* Copy an argument of a number of doubles; zeros where it is empty and may be. */
static void take(const mxArray * given, const char * name, size_t count, int needed, double * to)
{
  size_t found = mxGetNumberOfElements(given);
  if (!mxIsDouble(given) || mxIsComplex(given) || (found != count && (needed || found != 0))) {
    mexErrMsgIdAndTxt("stewart_dynamics:argument", "%s: must be %d real doubles", name, (int)count);
  }
  memset(to, 0, count * sizeof(double));
  memcpy(to, mxGetPr(given), found * sizeof(double));
}

static void give(const double * from, mxArray ** to)
{
  *to = mxCreateDoubleMatrix(6, 1, mxREAL);
  memcpy(mxGetPr(*to), from, 6 * sizeof(double));
}

void mexFunction(int n_out, mxArray * out[], int n_in, const mxArray * in[])
{
  stewart_platform platform = HEXAPOD;
  stewart_motion motion;
  stewart_state state;
  stewart_output output;
  double columns[9], twist[6], acceleration[6], payload[10] = {0.0};
  int code = STEWART_OK;
  if (n_in < 4 || n_in > 5) {
    mexErrMsgIdAndTxt("stewart_dynamics:argument",
      "must be called with position, rotation, twist, acceleration and perhaps payload");
  }
  take(in[0], "position", 3, 1, motion.position);
  take(in[1], "rotation", 9, 1, columns);
  take(in[2], "twist", 6, 0, twist);
  take(in[3], "acceleration", 6, 0, acceleration);
  for (int n = 0; n < 9; n++) {motion.rotation[n] = columns[3 * (n % 3) + n / 3];}
  memcpy(motion.linear_velocity, twist, sizeof motion.linear_velocity);
  memcpy(motion.angular_velocity, twist + 3, sizeof motion.angular_velocity);
  memcpy(motion.linear_acceleration, acceleration, sizeof motion.linear_acceleration);
  memcpy(motion.angular_acceleration, acceleration + 3, sizeof motion.angular_acceleration);
  if (n_in == 5) {take(in[4], "payload", 10, 0, payload);}
  if (payload[0] != 0.0) {
    code = stewart_add_payload(&platform, payload[0], payload + 1, payload + 4);
  }
  memset(&state, 0, sizeof state);  /* each call by itself: no memory of a warning */
  memset(&output, 0, sizeof output);
  if (code == STEWART_OK) {code = stewart_step(&platform, &motion, NULL, NULL, 0, &state, &output);}
  give(output.forces, &out[0]);
  if (n_out > 1) {give(output.result.lengths, &out[1]);}
  if (n_out > 2) {out[2] = mxCreateDoubleScalar(code);}
}

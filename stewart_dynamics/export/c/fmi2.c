// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

/*
 * The functions of FMI 2.0 for co-simulation (fmi-standard.org, Functional Mock-up Interface 2.0)
 * around the instance of fmu.h. Types are those of the standard's headers, which are not needed.
 */

#include "fmu.h"

#include <stdlib.h>
#include <string.h>

#ifndef fmi2FunctionTypes_h  /* the standard's header is not included */
typedef enum {fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending} fmi2Status;
typedef enum {fmi2ModelExchange, fmi2CoSimulation} fmi2Type;
typedef enum {fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated}
  fmi2StatusKind;
typedef void (* fmi2CallbackLogger)(
  void *, const char *, fmi2Status, const char *, const char *, ...);
typedef struct {
  fmi2CallbackLogger logger;
  void * (* allocateMemory)(size_t, size_t);
  void (* freeMemory)(void *);
  void (* stepFinished)(void *, fmi2Status);
  void * componentEnvironment;
} fmi2CallbackFunctions;
#endif

#ifdef FMI2_FUNCTION_PREFIX  /* static linking, of one hexapod beside other FMUs */
#define PASTE(a, b) a ## b
#define PASTE_EXPANDED(a, b) PASTE(a, b)
#define FUNCTION(type, name) type PASTE_EXPANDED(FMI2_FUNCTION_PREFIX, name)
#else
#define FUNCTION(type, name) FMU_EXPORT type name
#endif
#define STATUS(name) FUNCTION(fmi2Status, name)

#ifdef __GNUC__  /* most functions use some of their parameters alone */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static fmi2Status say(const fmu_instance * instance, fmi2Status status, const char * text)
{
  fmi2CallbackLogger log = (fmi2CallbackLogger)instance->log;
  if (log != NULL) {
    log(instance->environment, instance->name, status, status == fmi2Error ? "logStatusError" :
        "logStatusWarning", "%s", text);
  }
  return status;
}

static fmi2Status step(fmu_instance * instance, double time)
{
  double before = instance->memory.values[FMU_STATUS];
  int code = fmu_step(instance, time);
  if (code == STEWART_OK) {
    return fmi2OK;
  }
  return code == (int)before ? fmi2Warning : say(instance, fmi2Warning, fmu_text(code));
}

/* ---- one instance ---------------------------------------------------------------------------- */

FUNCTION(const char *, fmi2GetTypesPlatform)(void) {return "default";}

FUNCTION(const char *, fmi2GetVersion)(void) {return "2.0";}

FUNCTION(void *, fmi2Instantiate)(
  const char * name, fmi2Type type, const char * guid, const char * resources,
  const fmi2CallbackFunctions * functions, int visible, int logging)
{
  fmu_instance * instance = type == fmi2CoSimulation ? fmu_create(guid) : NULL;
  if (instance != NULL) {
    instance->environment = functions->componentEnvironment;
    instance->log = (void (*)(void))functions->logger;
    strncpy(instance->name, name, sizeof instance->name - 1);
  }
  return instance;
}

FUNCTION(void, fmi2FreeInstance)(void * instance) {free(instance);}

STATUS(fmi2SetDebugLogging)(void * instance, int on, size_t n, const char * const categories[])
{
  return fmi2OK;
}

STATUS(fmi2SetupExperiment)(
  void * instance, int tolerance_defined, double tolerance, double start_time,
  int stop_time_defined, double stop_time)
{
  ((fmu_instance *)instance)->memory.values[FMU_TIME] = start_time;
  return fmi2OK;
}

STATUS(fmi2EnterInitializationMode)(void * instance)
{
  ((fmu_instance *)instance)->memory.initializing = 1;
  return fmi2OK;
}

STATUS(fmi2ExitInitializationMode)(void * instance)
{
  fmu_memory * memory = &((fmu_instance *)instance)->memory;
  fmi2Status status = step(instance, memory->values[FMU_TIME]);
  memory->initializing = 0;
  return status;
}

STATUS(fmi2DoStep)(void * instance, double time, double size, int no_set_state_prior)
{
  fmi2Status status = step(instance, time);
  ((fmu_instance *)instance)->memory.values[FMU_TIME] = time + size;
  return status;
}

STATUS(fmi2Terminate)(void * instance) {return fmi2OK;}

STATUS(fmi2Reset)(void * instance)
{
  fmu_reset(instance);
  return fmi2OK;
}

/* ---- variables ------------------------------------------------------------------------------- */

#define ACCESS(Type, c_type, type) \
  STATUS(fmi2Get ## Type)( \
    void * instance, const unsigned references[], size_t n, c_type values[]) \
  { \
    fmu_instance * me = instance; \
    size_t k; \
    if (me->memory.initializing) { \
      fmu_step(me, me->memory.values[FMU_TIME]); \
    } \
    for (k = 0; k < n; k++) { \
      const double * value = fmu_value(me, references[k], type, 0); \
      if (value == NULL) { \
        return say(me, fmi2Error, "fmi2Get" #Type ": no such variable"); \
      } \
      values[k] = (c_type)*value; \
    } \
    return fmi2OK; \
  } \
  STATUS(fmi2Set ## Type)( \
    void * instance, const unsigned references[], size_t n, const c_type values[]) \
  { \
    fmu_instance * me = instance; \
    size_t k; \
    for (k = 0; k < n; k++) { \
      double * value = fmu_value(me, references[k], type, 1); \
      if (value == NULL) { \
        return say(me, fmi2Error, "fmi2Set" #Type ": no such input or parameter"); \
      } \
      *value = (double)values[k]; \
    } \
    return fmi2OK; \
  }

ACCESS(Real, double, FMU_REAL)
ACCESS(Integer, int, FMU_INTEGER)
ACCESS(Boolean, int, FMU_BOOLEAN)

/* ---- state ----------------------------------------------------------------------------------- */

STATUS(fmi2GetFMUstate)(void * instance, void ** state)
{
  if (*state == NULL) {
    *state = malloc(sizeof(fmu_memory));
  }
  if (*state == NULL) {
    return say(instance, fmi2Error, "fmi2GetFMUstate: out of memory");
  }
  *(fmu_memory *)*state = ((fmu_instance *)instance)->memory;
  return fmi2OK;
}

STATUS(fmi2SetFMUstate)(void * instance, void * state)
{
  ((fmu_instance *)instance)->memory = *(const fmu_memory *)state;
  return fmi2OK;
}

STATUS(fmi2FreeFMUstate)(void * instance, void ** state)
{
  free(*state);
  *state = NULL;
  return fmi2OK;
}

/* ---- functions that must exist, of capabilities that this FMU does not have ------------------- */

#define UNSUPPORTED(name, ...) STATUS(name)(void * c, __VA_ARGS__) {return fmi2Error;}
#define REFERENCES const unsigned r[], size_t n

UNSUPPORTED(fmi2GetString, REFERENCES, const char * v[])
UNSUPPORTED(fmi2SetString, REFERENCES, const char * const v[])
UNSUPPORTED(fmi2SerializedFMUstateSize, void * s, size_t * n)
UNSUPPORTED(fmi2SerializeFMUstate, void * s, char b[], size_t n)
UNSUPPORTED(fmi2DeSerializeFMUstate, const char b[], size_t n, void ** s)
UNSUPPORTED(
  fmi2GetDirectionalDerivative, REFERENCES, const unsigned k[], size_t n_k, const double d[],
  double v[])
UNSUPPORTED(fmi2SetRealInputDerivatives, REFERENCES, const int o[], const double v[])
UNSUPPORTED(fmi2GetRealOutputDerivatives, REFERENCES, const int o[], double v[])
UNSUPPORTED(fmi2GetStatus, const fmi2StatusKind s, fmi2Status * v)
UNSUPPORTED(fmi2GetRealStatus, const fmi2StatusKind s, double * v)
UNSUPPORTED(fmi2GetIntegerStatus, const fmi2StatusKind s, int * v)
UNSUPPORTED(fmi2GetBooleanStatus, const fmi2StatusKind s, int * v)
UNSUPPORTED(fmi2GetStringStatus, const fmi2StatusKind s, const char ** v)
STATUS(fmi2CancelStep)(void * c) {return fmi2Error;}

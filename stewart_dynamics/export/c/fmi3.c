// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

/*
 * The functions of FMI 3.0 for co-simulation (fmi-standard.org, Functional Mock-up Interface 3.0)
 * around the instance of fmu.h. Types are those of the standard's headers, which are not needed.
 */

#include "fmu.h"

#include <stdbool.h>
#include <stdlib.h>

#ifndef fmi3FunctionTypes_h  /* the standard's header is not included */
typedef enum {fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal} fmi3Status;
typedef enum {fmi3DependencyKind_} fmi3DependencyKind;
typedef enum {fmi3IntervalQualifier_} fmi3IntervalQualifier;
typedef void (* fmi3LogMessageCallback)(void *, fmi3Status, const char *, const char *);
typedef void (* fmi3ClockUpdateCallback)(void *);
typedef void (* fmi3LockPreemptionCallback)(void);
typedef void (* fmi3UnlockPreemptionCallback)(void);
typedef void (* fmi3IntermediateUpdateCallback)(
  void *, double, bool, bool, bool, bool, bool *, double *);
#endif

#ifdef FMI3_FUNCTION_PREFIX  /* static linking, of one hexapod beside other FMUs */
#define PASTE(a, b) a ## b
#define PASTE_EXPANDED(a, b) PASTE(a, b)
#define FUNCTION(type, name) type PASTE_EXPANDED(FMI3_FUNCTION_PREFIX, name)
#else
#define FUNCTION(type, name) FMU_EXPORT type name
#endif
#define STATUS(name) FUNCTION(fmi3Status, name)

#ifdef __GNUC__  /* most functions use some of their parameters alone */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static fmi3Status say(const fmu_instance * instance, fmi3Status status, const char * text)
{
  fmi3LogMessageCallback log = (fmi3LogMessageCallback)instance->log;
  if (log != NULL) {
    log(instance->environment, status, status == fmi3Error ? "logStatusError" :
        "logStatusWarning", text);
  }
  return status;
}

static fmi3Status step(fmu_instance * instance, double time)
{
  double before = instance->memory.values[FMU_STATUS];
  int code = fmu_step(instance, time);
  if (code == STEWART_OK) {
    return fmi3OK;
  }
  return code == (int)before ? fmi3Warning : say(instance, fmi3Warning, fmu_text(code));
}

/* ---- one instance ---------------------------------------------------------------------------- */

FUNCTION(const char *, fmi3GetVersion)(void) {return "3.0";}

FUNCTION(void *, fmi3InstantiateCoSimulation)(
  const char * name, const char * token, const char * resources, bool visible, bool logging,
  bool event_mode, bool early_return, const uint32_t references[], size_t n_references,
  void * environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
  fmu_instance * instance = fmu_create(token);
  if (instance != NULL) {
    instance->environment = environment;
    instance->log = (void (*)(void))log;
  }
  return instance;
}

FUNCTION(void *, fmi3InstantiateModelExchange)(
  const char * name, const char * token, const char * resources, bool visible, bool logging,
  void * environment, fmi3LogMessageCallback log) {return NULL;}

FUNCTION(void *, fmi3InstantiateScheduledExecution)(
  const char * name, const char * token, const char * resources, bool visible, bool logging,
  void * environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
  fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {return NULL;}

FUNCTION(void, fmi3FreeInstance)(void * instance) {free(instance);}

STATUS(fmi3SetDebugLogging)(void * instance, bool on, size_t n, const char * const categories[])
{
  return fmi3OK;
}

STATUS(fmi3EnterInitializationMode)(
  void * instance, bool tolerance_defined, double tolerance, double start_time,
  bool stop_time_defined, double stop_time)
{
  fmu_memory * memory = &((fmu_instance *)instance)->memory;
  memory->values[FMU_TIME] = start_time;
  memory->initializing = 1;
  return fmi3OK;
}

STATUS(fmi3ExitInitializationMode)(void * instance)
{
  fmu_memory * memory = &((fmu_instance *)instance)->memory;
  fmi3Status status = step(instance, memory->values[FMU_TIME]);
  memory->initializing = 0;
  return status;
}

STATUS(fmi3DoStep)(
  void * instance, double time, double size, bool no_set_state_prior, bool * event_needed,
  bool * terminate, bool * early_return, double * last_time)
{
  fmi3Status status = step(instance, time);
  ((fmu_instance *)instance)->memory.values[FMU_TIME] = time + size;
  *event_needed = *terminate = *early_return = false;
  *last_time = time + size;
  return status;
}

STATUS(fmi3Terminate)(void * instance) {return fmi3OK;}

STATUS(fmi3Reset)(void * instance)
{
  fmu_reset(instance);
  return fmi3OK;
}

/* ---- variables ------------------------------------------------------------------------------- */

/* Each type has the same two functions; types that no variable has accept no reference. */
#define ACCESS(Type, c_type, type) \
  STATUS(fmi3Get ## Type)( \
    void * instance, const uint32_t references[], size_t n, c_type values[], size_t n_values) \
  { \
    fmu_instance * me = instance; \
    size_t k; \
    if (me->memory.initializing) { \
      fmu_step(me, me->memory.values[FMU_TIME]); \
    } \
    for (k = 0; k < n; k++) { \
      const double * value = fmu_value(me, references[k], type, 0); \
      if (value == NULL || n_values != n) { \
        return say(me, fmi3Error, "fmi3Get" #Type ": no such variable"); \
      } \
      values[k] = (c_type)*value; \
    } \
    return fmi3OK; \
  } \
  STATUS(fmi3Set ## Type)( \
    void * instance, const uint32_t references[], size_t n, const c_type values[], \
    size_t n_values) \
  { \
    fmu_instance * me = instance; \
    size_t k; \
    for (k = 0; k < n; k++) { \
      double * value = fmu_value(me, references[k], type, 1); \
      if (value == NULL || n_values != n) { \
        return say(me, fmi3Error, "fmi3Set" #Type ": no such input or parameter"); \
      } \
      *value = (double)values[k]; \
    } \
    return fmi3OK; \
  }

ACCESS(Float64, double, FMU_REAL)
ACCESS(Int32, int32_t, FMU_INTEGER)
ACCESS(Boolean, bool, FMU_BOOLEAN)
ACCESS(Float32, float, FMU_OTHER)
ACCESS(Int8, int8_t, FMU_OTHER)
ACCESS(UInt8, uint8_t, FMU_OTHER)
ACCESS(Int16, int16_t, FMU_OTHER)
ACCESS(UInt16, uint16_t, FMU_OTHER)
ACCESS(UInt32, uint32_t, FMU_OTHER)
ACCESS(Int64, int64_t, FMU_OTHER)
ACCESS(UInt64, uint64_t, FMU_OTHER)

/* ---- state ----------------------------------------------------------------------------------- */

STATUS(fmi3GetFMUState)(void * instance, void ** state)
{
  if (*state == NULL) {
    *state = malloc(sizeof(fmu_memory));
  }
  if (*state == NULL) {
    return say(instance, fmi3Error, "fmi3GetFMUState: out of memory");
  }
  *(fmu_memory *)*state = ((fmu_instance *)instance)->memory;
  return fmi3OK;
}

STATUS(fmi3SetFMUState)(void * instance, void * state)
{
  ((fmu_instance *)instance)->memory = *(const fmu_memory *)state;
  return fmi3OK;
}

STATUS(fmi3FreeFMUState)(void * instance, void ** state)
{
  free(*state);
  *state = NULL;
  return fmi3OK;
}

/* ---- functions that must exist, of capabilities that this FMU does not have ------------------- */

#define UNSUPPORTED(name, ...) STATUS(name)(void * c, __VA_ARGS__) {return fmi3Error;}
#define REFERENCES const uint32_t r[], size_t n

UNSUPPORTED(fmi3GetString, REFERENCES, const char * v[], size_t m)
UNSUPPORTED(fmi3SetString, REFERENCES, const char * const v[], size_t m)
UNSUPPORTED(fmi3GetBinary, REFERENCES, size_t s[], const uint8_t * v[], size_t m)
UNSUPPORTED(fmi3SetBinary, REFERENCES, const size_t s[], const uint8_t * const v[], size_t m)
UNSUPPORTED(fmi3GetClock, REFERENCES, bool v[])
UNSUPPORTED(fmi3SetClock, REFERENCES, const bool v[])
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, uint32_t r, size_t * n)
UNSUPPORTED(
  fmi3GetVariableDependencies, uint32_t r, size_t d[], uint32_t i[], size_t e[],
  fmi3DependencyKind k[], size_t n)
UNSUPPORTED(fmi3SerializedFMUStateSize, void * s, size_t * n)
UNSUPPORTED(fmi3SerializeFMUState, void * s, uint8_t b[], size_t n)
UNSUPPORTED(fmi3DeserializeFMUState, const uint8_t b[], size_t n, void ** s)
UNSUPPORTED(
  fmi3GetDirectionalDerivative, REFERENCES, const uint32_t k[], size_t n_k, const double s[],
  size_t n_s, double v[], size_t m)
UNSUPPORTED(
  fmi3GetAdjointDerivative, REFERENCES, const uint32_t k[], size_t n_k, const double s[],
  size_t n_s, double v[], size_t m)
UNSUPPORTED(fmi3GetIntervalDecimal, REFERENCES, double i[], fmi3IntervalQualifier q[])
UNSUPPORTED(
  fmi3GetIntervalFraction, REFERENCES, uint64_t k[], uint64_t s[], fmi3IntervalQualifier q[])
UNSUPPORTED(fmi3GetShiftDecimal, REFERENCES, double s[])
UNSUPPORTED(fmi3GetShiftFraction, REFERENCES, uint64_t k[], uint64_t s[])
UNSUPPORTED(fmi3SetIntervalDecimal, REFERENCES, const double i[])
UNSUPPORTED(fmi3SetIntervalFraction, REFERENCES, const uint64_t k[], const uint64_t s[])
UNSUPPORTED(fmi3SetShiftDecimal, REFERENCES, const double s[])
UNSUPPORTED(fmi3SetShiftFraction, REFERENCES, const uint64_t k[], const uint64_t s[])
UNSUPPORTED(
  fmi3UpdateDiscreteStates, bool * u, bool * t, bool * n, bool * v, bool * d, double * time)
UNSUPPORTED(fmi3CompletedIntegratorStep, bool p, bool * e, bool * t)
UNSUPPORTED(fmi3SetTime, double time)
UNSUPPORTED(fmi3SetContinuousStates, const double x[], size_t n)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, double x[], size_t n)
UNSUPPORTED(fmi3GetEventIndicators, double z[], size_t n)
UNSUPPORTED(fmi3GetContinuousStates, double x[], size_t n)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, double x[], size_t n)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t * n)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t * n)
UNSUPPORTED(fmi3GetOutputDerivatives, REFERENCES, const int32_t o[], double v[], size_t m)
UNSUPPORTED(fmi3ActivateModelPartition, uint32_t r, double time)
STATUS(fmi3EnterEventMode)(void * c) {return fmi3Error;}
STATUS(fmi3EnterConfigurationMode)(void * c) {return fmi3Error;}
STATUS(fmi3ExitConfigurationMode)(void * c) {return fmi3Error;}
STATUS(fmi3EvaluateDiscreteStates)(void * c) {return fmi3Error;}
STATUS(fmi3EnterContinuousTimeMode)(void * c) {return fmi3Error;}
STATUS(fmi3EnterStepMode)(void * c) {return fmi3Error;}

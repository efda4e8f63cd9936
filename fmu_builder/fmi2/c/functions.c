/* The functions of FMI 2.0 for Model Exchange and Co-Simulation: checks, messages and types; the work is done by the slave.
   Every error leaves the instance as it was, except an error of the model in a tick. */
#include <stddef.h>
#include <stdlib.h>

#include "fmi2Functions.h"

#ifdef FMI2_FUNCTION_PREFIX /* some fmi2Functions.h ignore it; the names below follow this definition when used */
#define PASTE(prefix, name) prefix##name
#define PASTE_EXPANDED(prefix, name) PASTE(prefix, name)
#undef fmi2FullName
#define fmi2FullName(name) PASTE_EXPANDED(FMI2_FUNCTION_PREFIX, name)
#endif

#include "instance.c"
#include "saved_states.c"

/* Life of an instance */

FMI2_Export const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

FMI2_Export const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

static int same_text(const char *left, const char *right)
{
    while (*left != '\0' && *left == *right) {
        ++left;
        ++right;
    }
    return *left == *right;
}

FMI2_Export COLD fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                          fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                          fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const char *trouble = NULL;
    const fmi2CallbackLogger logger = functions != NULL ? functions->logger : NULL;
    const fmi2ComponentEnvironment environment = functions != NULL ? functions->componentEnvironment : NULL;
    const char *name = instanceName != NULL ? instanceName : MODEL_IDENTIFIER;
    Instance *instance = NULL;
    (void)fmuResourceLocation;
    (void)visible;
    if (fmuType != fmi2CoSimulation && fmuType != fmi2ModelExchange) {
        trouble = "fmi2Instantiate: the type is neither model exchange nor co-simulation";
    } else if (fmuGUID == NULL || !same_text(fmuGUID, MODEL_GUID)) {
        trouble = "fmi2Instantiate: the GUID is not that of this FMU, " MODEL_GUID;
    } else if ((instance = (Instance *)calloc(1, sizeof(Instance))) == NULL) {
        trouble = "fmi2Instantiate: out of memory";
    }
    if (trouble != NULL) {
        if (logger != NULL) {
            logger(environment, name, fmi2Error, "logStatusError", trouble);
        }
        return NULL;
    }
    for (unsigned k = 0; k + 1 < NAME_CAPACITY && name[k] != '\0'; ++k) {
        instance->name[k] = name[k];
    }
    instance->logger = logger;
    instance->environment = environment;
    instance->logged = loggingOn ? LOG_ALL : LOG_ALL - LOG_EVENT;
    instance->last_step = fmi2OK;
    instance->slave.purpose = fmuType == fmi2ModelExchange ? FOR_MODEL_EXCHANGE : FOR_CO_SIMULATION;
    slave_reset(&instance->slave);
    return instance;
}

FMI2_Export void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

FMI2_Export COLD fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                           const fmi2String categories[])
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_SetDebugLogging, "fmi2SetDebugLogging", &message);
    unsigned named = nCategories == 0 ? LOG_ALL : 0;
    if (instance == NULL) {
        return fmi2Error;
    }
    for (size_t k = 0; k < nCategories; ++k) {
        const char *category = categories != NULL && categories[k] != NULL ? categories[k] : "(NULL)";
        unsigned kinds = 0;
        for (unsigned known = 0; known < LOG_CATEGORIES; ++known) {
            kinds |= same_text(category, log_categories[known].name) ? log_categories[known].kinds : 0U;
        }
        named |= kinds;
        if (kinds == 0) {
            message_append(&message, "unknown log category ");
            return instance_error(instance, &message, category);
        }
    }
    instance->logged = loggingOn ? instance->logged | named : instance->logged & ~named;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_SetupExperiment, "fmi2SetupExperiment", &message);
    (void)toleranceDefined; /* the steps are fixed: there is no error estimate to compare it with */
    (void)tolerance;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (!is_finite(startTime)) {
        return instance_error(instance, &message, "the start time must be a finite number");
    }
    if (stopTimeDefined && !(stopTime >= startTime)) {
        return instance_error(instance, &message, "the stop time must not be before the start time");
    }
    instance->slave.start_time = startTime;
    instance->slave.stop_time = stopTimeDefined ? stopTime : LARGEST_NUMBER;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_EnterInitializationMode, "fmi2EnterInitializationMode", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->slave.mode = MODE_INITIALISATION;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_ExitInitializationMode, "fmi2ExitInitializationMode", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (slave_start(&instance->slave, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    instance_ticked(instance);
    message_append(&message, "initialised, tick of the model ");
    message_append_number(&message, instance->slave.sample_time);
    message_append(&message, " s");
    return instance_log(instance, fmi2OK, &message);
}

FMI2_Export COLD fmi2Status fmi2Terminate(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_Terminate, "fmi2Terminate", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->slave.mode = MODE_TERMINATED;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2Reset(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_Reset, "fmi2Reset", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    slave_reset(&instance->slave);
    for (unsigned k = 0; k < VARIABLE_COUNT; ++k) {
        instance->warned[k] = 0;
    }
    instance->warned_of_events = 0;
    instance->warned_of_parameters = 0;
    instance->warned_of_ticks = 0;
    instance->last_step = fmi2OK;
    return fmi2OK;
}

/* Values */

/** one getter: values[k] = the value of vr[k], nothing written on error */
#define DEFINE_GET(name, type, types)                                                                         \
    FMI2_Export fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, type value[])     \
    {                                                                                                         \
        const fmi2Status status = instance_to_read(c, vr, nvr, value, types, #name);                          \
        for (size_t k = 0; status == fmi2OK && k < nvr; ++k) {                                                \
            value[k] = (type)((const Instance *)c)->slave.values[vr[k]];                                      \
        }                                                                                                     \
        return status;                                                                                        \
    }

/** one setter: all values are checked before the first is stored; what is refused leaves no trace, not even a warning
    that is given once */
#define DEFINE_SET(kept, name, type, types, as_double, legal)                                                 \
    FMI2_Export kept fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const type value[]) \
    {                                                                                                         \
        Message message;                                                                                      \
        Instance *instance = instance_of(c, legal, #name, &message);                                          \
        if (instance == NULL || !instance_knows(instance, vr, nvr, value, types, &message)) {                 \
            return fmi2Error;                                                                                 \
        }                                                                                                     \
        for (size_t k = 0; k < nvr; ++k) {                                                                    \
            if (!instance_accepts(instance, vr[k], as_double(value[k]), &message)) {                          \
                return fmi2Error;                                                                             \
            }                                                                                                 \
        }                                                                                                     \
        const int parameters = instance_has_parameters(vr, nvr);                                              \
        for (unsigned k = 0; parameters && k < VARIABLE_COUNT; ++k) {                                         \
            instance->before[k] = instance->slave.values[k];                                                  \
        }                                                                                                     \
        for (size_t k = 0; k < nvr; ++k) {                                                                    \
            instance->slave.values[vr[k]] = as_double(value[k]);                                              \
            slave_values_changed(&instance->slave);                                                           \
        }                                                                                                     \
        if (parameters && instance_parameters_set(instance) != fmi2OK) {                                      \
            return fmi2Error;                                                                                 \
        }                                                                                                     \
        for (size_t k = 0; k < nvr; ++k) {                                                                    \
            instance_report(instance, vr[k], as_double(value[k]));                                            \
        }                                                                                                     \
        return fmi2OK;                                                                                        \
    }

#define AS_DOUBLE(value) ((double)(value))
#define AS_LOGICAL(value) ((value) != fmi2False ? 1.0 : 0.0)

DEFINE_GET(fmi2GetReal, fmi2Real, TYPE_REAL)
DEFINE_GET(fmi2GetInteger, fmi2Integer, TYPE_INTEGER | TYPE_ENUMERATION)
DEFINE_GET(fmi2GetBoolean, fmi2Boolean, TYPE_BOOLEAN)
DEFINE_SET(, fmi2SetReal, fmi2Real, TYPE_REAL, AS_DOUBLE, LEGAL_SetReal)
DEFINE_SET(COLD, fmi2SetInteger, fmi2Integer, TYPE_INTEGER | TYPE_ENUMERATION, AS_DOUBLE, LEGAL_SetDiscrete)
DEFINE_SET(COLD, fmi2SetBoolean, fmi2Boolean, TYPE_BOOLEAN, AS_LOGICAL, LEGAL_SetDiscrete)

/* There are no strings: every value reference is of another type. */

FMI2_Export COLD fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return instance_to_read(c, vr, nvr, value, 0, "fmi2GetString");
}

FMI2_Export COLD fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                     const fmi2String value[])
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_SetDiscrete, "fmi2SetString", &message);
    return instance != NULL && instance_knows(instance, vr, nvr, value, 0, &message) ? fmi2OK : fmi2Error;
}

#include "derivatives.c"
#include "stepping.c"
#include "model_exchange.c"

/* An FMU as a careless vendor might ship it: what it does wrong is chosen by its parameter `deed`. */
#include <stddef.h>

#include "variables.h"

enum deed { GOOD, WRITES_NOWHERE, TRAPS, HANGS, FAILS, POISONS, FORGETS_RESET, REFUSES_RESET };
enum { OK = 0, ERROR = 3, INSTANCES = 4, NUMBERS = 6, Y = 2, IN_RANGE = 3, DEED = 4, GAIN = 5, LATE_STEP = 20 };

struct instance {
    double values[NUMBERS];
    int used, step;
};

static struct instance instances[INSTANCES];
static int poisoned; /* outlives instances, as damaged memory does */

static void restart(struct instance *self)
{
    const struct instance blank = {{0}, 1, 0};
    *self = blank;
    self->values[GAIN] = 1.0;
}

#define NOTHING(name)              \
    EXPORTED int fmi2##name(void); \
    int fmi2##name(void)           \
    {                              \
        return OK;                 \
    }

EXPORTED const char *fmi2GetTypesPlatform(void);
EXPORTED const char *fmi2GetVersion(void);
EXPORTED void *fmi2Instantiate(void);
EXPORTED void fmi2FreeInstance(void *pointer);
EXPORTED int fmi2Reset(void *pointer);
EXPORTED int fmi2GetReal(void *pointer, const unsigned *references, size_t count, double *values);
EXPORTED int fmi2GetBoolean(void *pointer, const unsigned *references, size_t count, int *values);
EXPORTED int fmi2SetReal(void *pointer, const unsigned *references, size_t count, const double *values);
EXPORTED int fmi2DoStep(void *pointer, double time, double step, int no_return);

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

void *fmi2Instantiate(void)
{
    int k;
    for (k = 0; k < INSTANCES; k++) {
        if (!instances[k].used) {
            restart(&instances[k]);
            return &instances[k];
        }
    }
    return NULL;
}

void fmi2FreeInstance(void *pointer)
{
    ((struct instance *)pointer)->used = 0;
}

int fmi2Reset(void *pointer)
{
    struct instance *self = pointer;
    const enum deed deed = (enum deed)self->values[DEED];
    const double y = self->values[Y];
    if (deed == REFUSES_RESET) {
        return ERROR;
    }
    restart(self);
    if (deed == FORGETS_RESET) {
        self->values[Y] = y;
    }
    return OK;
}

int fmi2GetReal(void *pointer, const unsigned *references, size_t count, double *values)
{
    const struct instance *self = pointer;
    size_t k;
    for (k = 0; k < count; k++) {
        values[k] = self->values[references[k]];
    }
    return OK;
}

int fmi2GetBoolean(void *pointer, const unsigned *references, size_t count, int *values)
{
    const struct instance *self = pointer;
    size_t k;
    (void)references;
    for (k = 0; k < count; k++) {
        values[k] = self->step < LATE_STEP;
    }
    return OK;
}

int fmi2SetReal(void *pointer, const unsigned *references, size_t count, const double *values)
{
    struct instance *self = pointer;
    size_t k;
    for (k = 0; k < count; k++) {
        self->values[references[k]] = values[k];
    }
    return OK;
}

int fmi2DoStep(void *pointer, double time, double step, int no_return)
{
    struct instance *self = pointer;
    const enum deed deed = (enum deed)self->values[DEED];
    int *volatile nowhere = NULL;
    volatile int waiting = 1;
    (void)time;
    (void)no_return;
    self->values[Y] += step * self->values[GAIN] * (self->values[0] + 1e-3 * self->values[1] - self->values[Y]);
    self->step++;
    if (self->step != LATE_STEP) {
        return OK;
    }
    if (deed == WRITES_NOWHERE || (deed == GOOD && poisoned)) {
        *nowhere = 1;
    }
    if (deed == TRAPS) {
        __builtin_trap();
    }
    while (deed == HANGS && waiting) {
    }
    if (deed == POISONS) {
        poisoned = 1;
    }
    return deed == FAILS ? ERROR : OK;
}

NOTHING(SetDebugLogging)
NOTHING(SetupExperiment)
NOTHING(EnterInitializationMode)
NOTHING(ExitInitializationMode)
NOTHING(Terminate)
NOTHING(GetInteger)
NOTHING(GetString)
NOTHING(SetInteger)
NOTHING(SetBoolean)
NOTHING(SetString)
NOTHING(GetFMUstate)
NOTHING(SetFMUstate)
NOTHING(FreeFMUstate)
NOTHING(SerializedFMUstateSize)
NOTHING(SerializeFMUstate)
NOTHING(DeSerializeFMUstate)
NOTHING(GetDirectionalDerivative)
NOTHING(SetRealInputDerivatives)
NOTHING(GetRealOutputDerivatives)
NOTHING(CancelStep)
NOTHING(GetStatus)
NOTHING(GetRealStatus)
NOTHING(GetIntegerStatus)
NOTHING(GetBooleanStatus)
NOTHING(GetStringStatus)

/* The FMU as an importer sees it: a table of its functions, linked in or loaded (FUZZ_LIBRARY). The heap it uses can be
   made to fail where its sources are compiled with fuzz_calloc and fuzz_free in the place of calloc and free. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "variables.h"

/** text number k of texts that stand one behind the other: names of variables */
static const char *text_at(const char *texts, unsigned k)
{
    for (; k > 0; --k) {
        texts += strlen(texts) + 1;
    }
    return texts;
}

#define FUNCTIONS(X)                                                                                        \
    X(GetTypesPlatform) X(GetVersion) X(SetDebugLogging) X(Instantiate) X(FreeInstance) X(SetupExperiment)  \
    X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset)                              \
    X(GetReal) X(GetInteger) X(GetBoolean) X(GetString) X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) \
    X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate) X(SerializedFMUstateSize) X(SerializeFMUstate)            \
    X(DeSerializeFMUstate) X(GetDirectionalDerivative)                                                      \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime) \
    X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators) X(GetContinuousStates)                   \
    X(GetNominalsOfContinuousStates)                                                                        \
    X(SetRealInputDerivatives) X(GetRealOutputDerivatives) X(DoStep) X(CancelStep) X(GetStatus)             \
    X(GetRealStatus) X(GetIntegerStatus) X(GetBooleanStatus) X(GetStringStatus)

#define MEMBER(name) fmi2##name##TYPE *name;
typedef struct {
    FUNCTIONS(MEMBER)
} Fmu;
static Fmu fmu;

/** what an oracle has seen; the sanitizers and valgrind end the program by themselves */
#define FAIL(...)                             \
    do {                                      \
        fprintf(stderr, "fuzz: " __VA_ARGS__); \
        fprintf(stderr, "\n");                \
        fflush(stderr);                       \
        abort();                              \
    } while (0)
#define REQUIRE(holds, ...)    \
    do {                       \
        if (!(holds)) {        \
            FAIL(__VA_ARGS__); \
        }                      \
    } while (0)

static long heap_balance; /* blocks the FMU has and has not given back */
static int heap_is_empty; /* allocations fail */

#ifdef FUZZ_LIBRARY
#include <dlfcn.h>

enum { HEAP_CAN_FAIL = 0 };

static void fmu_load(void)
{
    const char *path = getenv("FUZZ_LIBRARY");
    void *library = path != NULL ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
    REQUIRE(library != NULL, "the FMU's binary does not load: %s", path != NULL ? dlerror() : "FUZZ_LIBRARY is not set");
#define LOAD(name) *(void **)&fmu.name = dlsym(library, "fmi2" #name);
    FUNCTIONS(LOAD)
#define LOADED(name) REQUIRE(fmu.name != NULL, "fmi2" #name " is missing");
    FUNCTIONS(LOADED)
}
#else
enum { HEAP_CAN_FAIL = 1 };

void *fuzz_calloc(size_t count, size_t size);
void fuzz_free(void *memory);

void *fuzz_calloc(size_t count, size_t size)
{
    void *memory = heap_is_empty ? NULL : calloc(count, size);
    heap_balance += memory != NULL;
    return memory;
}

void fuzz_free(void *memory)
{
    heap_balance -= memory != NULL;
    free(memory);
}

static void fmu_load(void)
{
#define LINK(name) fmu.name = fmi2##name;
    FUNCTIONS(LINK)
}
#endif

/* The bytes that choose what is called; zeros behind their end. */
static const uint8_t *input_bytes;
static size_t input_size, input_at;

static unsigned take(void)
{
    return input_at < input_size ? input_bytes[input_at++] : 0U;
}

static unsigned take_below(unsigned limit)
{
    return take() % limit;
}

/** one time in `often` */
static int take_chance(unsigned often)
{
    return take_below(often) == 1U;
}

static double take_raw_double(void)
{
    unsigned char bytes[8];
    double value;
    for (unsigned k = 0; k < 8; ++k) {
        bytes[k] = (unsigned char)take();
    }
    memcpy(&value, bytes, sizeof value);
    return value;
}

/** a block of its own, so that a byte too far is seen; NULL for none at all, now and then */
static void *block(size_t count, size_t size)
{
    void *memory = malloc(count * size);
    REQUIRE(memory != NULL || count == 0, "out of memory");
    return memory;
}

static int same_bits(double one, double other)
{
    return memcmp(&one, &other, sizeof one) == 0;
}

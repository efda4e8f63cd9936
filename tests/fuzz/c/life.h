/* What the standard says of the life of an instance (FMI 2.0.4, sections 3.2.3 and 4.2.4), written down a second time and
   apart from the runtime; and pairs of instances. */

enum {
    BEFORE = 1,
    STARTING = 2,
    STEPPING = 4, /* co-simulation, between steps */
    EVENTS = 8,
    CONTINUOUS = 16,
    ENDED = 32,
    BROKEN = 64, /* the model has failed in a tick */
    UNKNOWN = 128, /* nobody outside can tell: nothing is expected */
    RUNNING = STEPPING | EVENTS | CONTINUOUS,
    READABLE = STARTING | RUNNING | ENDED | BROKEN,
    ALWAYS = BEFORE | READABLE
};

/** the call is legal in these modes of an instance of this kind, 0 where it never is */
static int legal_in(int kind, int co_simulation, int model_exchange)
{
    return kind == (int)fmi2ModelExchange ? model_exchange : co_simulation;
}

typedef struct {
    int mode;
    double start, stop, time, event; /* s */
    int given_slopes;                /* input derivatives wait for the next step */
    int tame;                        /* inputs have always been inside their limits */
} Life;

/* Two instances that are told the same. One is also asked for values, told what is not allowed and shares the program
   with others; the other is not. They must not differ. */
typedef struct {
    fmi2Component main, shadow;
    int kind;
    int migrated;        /* the shadow is a copy made while it lived: it may warn once more */
    int counts_messages; /* errors are logged, as nobody has changed what is */
    long messages;
    Life life;
    fmi2CallbackFunctions callbacks;
} Pair;

typedef struct {
    fmi2FMUstate main, shadow;
    int kind;
    Life life;
} Saved;

typedef struct {
    fmi2Byte *main, *shadow;
    size_t size;
    int kind;
    Life life;
} Stored;

enum { PAIRS = 3, SAVED = 3, STORED = 2 };
static Pair pairs[PAIRS];
static Saved saved[SAVED];
static Stored stored[STORED];

static void hear(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    REQUIRE(name != NULL && category != NULL && message != NULL, "a message without name, category or text");
    REQUIRE(strlen(message) < 1000 && strlen(message) > 5, "a message of odd length");
    REQUIRE(strchr(message, '%') == NULL && strchr(message, '#') == NULL, "a message with a mark of loggers: %s", message);
    REQUIRE(status <= fmi2Error, "a message of status %d", (int)status);
    REQUIRE(strncmp(category, "log", 3) == 0, "a message of category %s", category);
    if (environment != NULL && status == fmi2Error) {
        ++*(long *)environment;
    }
}

static const char *mode_text(int mode)
{
    return mode == BEFORE       ? "before initialisation"
           : mode == STARTING   ? "in initialisation"
           : mode == STEPPING   ? "between steps"
           : mode == EVENTS     ? "in event mode"
           : mode == CONTINUOUS ? "in continuous-time mode"
           : mode == ENDED      ? "after terminate"
           : mode == BROKEN     ? "after a failure"
                                : "somewhere";
}

/* What the arguments of a call promise. */
enum { MAY_FAIL, MUST_FAIL, MUST_WORK };

/** judge the answer of the main instance */
static void judge(const Pair *pair, const char *call, fmi2Status status, int legal, int promise, long messages)
{
    const char *where = mode_text(pair->life.mode);
    REQUIRE(status == fmi2OK || status == fmi2Warning || status == fmi2Discard || status == fmi2Error,
            "%s answers %d", call, (int)status);
    if (status == fmi2Error && pair->counts_messages) {
        REQUIRE(pair->messages > messages, "%s: an error without a message", call);
    }
    if (promise == MUST_FAIL) {
        REQUIRE(status == fmi2Error || status == fmi2Discard, "%s %s took what it must not", call, where);
    }
    if (pair->life.mode == UNKNOWN) {
        return;
    }
    if ((pair->life.mode & legal) == 0) {
        REQUIRE(status == fmi2Error, "%s is not allowed %s and answers %d", call, where, (int)status);
    } else if (promise == MUST_WORK) {
        REQUIRE(status == fmi2OK || status == fmi2Warning, "%s %s refuses what is right", call, where);
    }
}

/** the shadow has given the same answer */
static void judge_shadow(const Pair *pair, const char *call, fmi2Status status, fmi2Status other)
{
    const int both_went = pair->migrated && status <= fmi2Warning && other <= fmi2Warning;
    REQUIRE(status == other || both_went, "%s: %d, but %d on an instance that had a quiet life", call, (int)status,
            (int)other);
}

/** call both instances; the shadow hears nothing of what was refused. TRIED: a refusal may have changed something */
#define TELL(pair, legal, promise, tried, name, ...)                                                  \
    do {                                                                                              \
        const long heard = (pair)->messages;                                                          \
        status = fmu.name((pair)->main, __VA_ARGS__);                                                 \
        judge((pair), #name, status, (legal), (promise), heard);                                      \
        if (status != fmi2Error || ((tried) && (promise) != MUST_FAIL) || (pair)->life.mode == UNKNOWN) { \
            judge_shadow((pair), #name, status, fmu.name((pair)->shadow, __VA_ARGS__));               \
        }                                                                                             \
    } while (0)

/** ask the main instance only */
#define ASK(pair, legal, promise, name, ...)                     \
    do {                                                         \
        const long heard = (pair)->messages;                     \
        status = fmu.name((pair)->main, __VA_ARGS__);            \
        judge((pair), #name, status, (legal), (promise), heard); \
    } while (0)

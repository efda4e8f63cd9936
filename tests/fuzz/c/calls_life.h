/* Calls that make, free and move instances through their modes and through time. */

/** a text of many kilobytes */
static const char *huge_text(void)
{
    static char text[20001];
    if (text[0] == '\0') {
        memset(text, 'x', sizeof text - 1);
    }
    return text;
}

static fmi2Component instantiate(Pair *pair, const char *name, int has_logger, int has_callbacks, int loud)
{
    pair->callbacks.logger = has_logger ? hear : NULL;
    pair->callbacks.componentEnvironment = &pair->messages;
    return fmu.Instantiate(name, (fmi2Type)pair->kind, MODEL_GUID, NULL, has_callbacks ? &pair->callbacks : NULL, fmi2False, loud);
}

static void call_instantiate(Pair *pair)
{
    const char *const names[] = {"one", "", NULL, huge_text(), "per%cent#r1#"};
    const char *name = names[take_below(5)];
    const unsigned choice = take();
    const int has_callbacks = !take_chance(6), has_logger = has_callbacks && !take_chance(6);
    if (pair->main != NULL) {
        return;
    }
    memset(pair, 0, sizeof *pair);
    pair->kind = choice % 3 == 0 ? fmi2ModelExchange : fmi2CoSimulation;
    if (choice >= 232) { /* refused in one of five ways */
        const char *const guids[] = {NULL, "", "{00000000-0000-0000-0000-000000000000}", MODEL_GUID "}", huge_text()};
        const char *guid = choice == 255 ? MODEL_GUID : guids[choice % 5];
        const fmi2Type type = choice == 255 ? (fmi2Type)7 : (fmi2Type)pair->kind;
        pair->callbacks.logger = hear;
        REQUIRE(fmu.Instantiate(name, type, guid, huge_text(), choice % 2 ? &pair->callbacks : NULL, 1, 1) == NULL,
                "an instance in spite of a wrong GUID or type");
        return;
    }
    if (HEAP_CAN_FAIL && choice >= 224) {
        heap_is_empty = 1;
        pair->main = instantiate(pair, name, has_logger, has_callbacks, 1);
        heap_is_empty = 0;
        REQUIRE(pair->main == NULL, "an instance without memory");
        return;
    }
    pair->shadow = instantiate(pair, "shadow", 0, 0, 0);
    pair->main = instantiate(pair, name, has_logger, has_callbacks, (int)choice % 2);
    REQUIRE(pair->main != NULL && pair->shadow != NULL && pair->main != pair->shadow, "no instance");
    pair->counts_messages = has_logger;
    pair->life.mode = BEFORE;
    pair->life.stop = DBL_MAX;
    pair->life.tame = 1;
}

static void call_free(Pair *pair)
{
    fmu.FreeInstance(pair->main);
    fmu.FreeInstance(pair->shadow);
    pair->main = NULL;
    pair->shadow = NULL;
}

static void call_debug_logging(Pair *pair)
{
    const char *const known[] = {"logAll", "logEvents", "logStatusError", "logStatusWarning", "logStatusDiscard"};
    const unsigned count = take_below(4), wrong = take();
    fmi2String *categories = block(count, sizeof *categories);
    const int on = (int)take_below(2);
    int promise = MUST_WORK;
    fmi2Status status;
    for (unsigned k = 0; k < count; ++k) {
        categories[k] = known[take_below(5)];
        if (wrong % 8 == k) {
            categories[k] = wrong % 3 == 0 ? NULL : wrong % 3 == 1 ? huge_text() : "logall";
            promise = MUST_FAIL;
        }
    }
    ASK(pair, ALWAYS, promise, SetDebugLogging, on, count, categories);
    if (status == fmi2OK) {
        pair->counts_messages = 0;
    }
    ASK(pair, ALWAYS, MUST_FAIL, SetDebugLogging, on, 5, NULL);
    free((void *)categories);
}

/** call a function without further arguments; a refusal changes nothing */
static fmi2Status move(Pair *pair, fmi2Status (*function)(fmi2Component), const char *name, int legal, int promise, int mode)
{
    const long heard = pair->messages;
    const fmi2Status status = function(pair->main);
    judge(pair, name, status, legal, promise, heard);
    if (status != fmi2Error || pair->life.mode == UNKNOWN) {
        judge_shadow(pair, name, status, function(pair->shadow));
    }
    if (status != fmi2Error) {
        pair->life.mode = mode;
    }
    return status;
}

static void call_setup(Pair *pair)
{
    static const double starts[] = {0.0, 0.0, 0.0, 12.5, -3.0, 1e9, 1e300, -1e300};
    const unsigned choice = take();
    const double start = choice == 255 ? NAN : choice == 254 ? INFINITY : starts[choice % 8];
    const int has_stop = take_chance(3);
    const double stop = take_chance(5) ? start - 1.0 : start + 0.002 * (double)take() + 1e-3;
    const int promise = !isfinite(start) || (has_stop && !(stop >= start)) ? MUST_FAIL : MUST_WORK;
    fmi2Status status;
    TELL(pair, BEFORE, promise, 0, SetupExperiment, (fmi2Boolean)(take() % 2), take_raw_double(), start, has_stop, stop);
    if (status == fmi2OK) {
        pair->life.start = start;
        pair->life.stop = has_stop ? stop : DBL_MAX;
    }
}

static void call_enter_initialization(Pair *pair)
{
    move(pair, fmu.EnterInitializationMode, "EnterInitializationMode", BEFORE, MUST_WORK, STARTING);
}

static void call_exit_initialization(Pair *pair)
{
    const int promise = pair->life.tame ? MUST_WORK : MAY_FAIL;
    const int next = pair->kind == fmi2ModelExchange ? EVENTS : STEPPING;
    if (move(pair, fmu.ExitInitializationMode, "ExitInitializationMode", STARTING, promise, next) != fmi2Error) {
        pair->life.time = pair->life.event = pair->life.start;
    }
}

static void call_terminate(Pair *pair)
{
    move(pair, fmu.Terminate, "Terminate", RUNNING, MUST_WORK, ENDED);
}

static void call_reset(Pair *pair)
{
    const Life fresh = {BEFORE, 0.0, DBL_MAX, 0.0, 0.0, 0, 1};
    if (move(pair, fmu.Reset, "Reset", ALWAYS, MUST_WORK, BEFORE) != fmi2Error) {
        pair->life = fresh;
    }
}

/** through initialisation at once: bytes seldom find the way */
static void call_start(Pair *pair)
{
    if (take_chance(4)) {
        call_setup(pair);
    }
    call_enter_initialization(pair);
    if (take_chance(4)) {
        call_set_real(pair);
    }
    call_exit_initialization(pair);
}

static double take_step(void)
{
    static const double steps[] = {1e-3, 1e-3, 2e-3, 5e-4, 7e-4, 0.01, 0.05, 1.0 / 60.0, 2.5e-4, 1e-12};
    const unsigned choice = take();
    if (choice < 240) {
        return steps[choice % 10];
    }
    return choice < 243 ? 0.0 : choice < 246 ? -1e-3 : choice < 249 ? NAN : choice < 252 ? INFINITY : choice < 254 ? 1e300 : -DBL_MAX;
}

static void call_step(Pair *pair)
{
    Life *life = &pair->life;
    const double step = take_step();
    const unsigned choice = take();
    const double time = choice < 220   ? life->time
                        : choice < 235 ? life->time + 1e-7 * ((double)choice - 228.0)
                        : choice < 245 ? life->time + 1.0
                        : choice < 250 ? NAN
                                       : -INFINITY;
    const int right = time == life->time && step > 0.0 && step < 1.0 && time + step <= life->stop;
    const int wrong = !isfinite(time) || !(step > 0.0) || !isfinite(step) || time > life->time + 0.5 + 1e-9 * fabs(time) ||
                      (step >= 1.0 && fabs(life->time) < 1e290) || time + step > life->stop + 1.0;
    const int works = right && life->tame && CONTINUOUS_STATES == 0;
    const double before = life->time;
    fmi2Status status;
    TELL(pair, legal_in(pair->kind, STEPPING, 0), wrong ? MUST_FAIL : works ? MUST_WORK : MAY_FAIL, 1, DoStep, time, step,
         (fmi2Boolean)(choice % 2));
    if (status != fmi2Error) {
        life->time = time + step;
        life->given_slopes = 0;
    } else if (life->mode == STEPPING && !wrong) {
        life->mode = right && !life->given_slopes && fabs(before) < 1e6 ? BROKEN : UNKNOWN;
    }
}

static void call_status(Pair *pair)
{
    const fmi2StatusKind kind = (fmi2StatusKind)take_below(6);
    const int legal = legal_in(pair->kind, STEPPING | ENDED | BROKEN, 0);
    fmi2Status status, last = fmi2Fatal;
    fmi2Real time = NAN;
    fmi2Integer whole;
    fmi2Boolean logical;
    fmi2String text = NULL;
    ASK(pair, legal, MAY_FAIL, GetStatus, kind, &last);
    REQUIRE(status != fmi2OK || last == fmi2OK || last == fmi2Error, "the last step had the status %d", (int)last);
    ASK(pair, legal, MAY_FAIL, GetRealStatus, kind, &time);
    REQUIRE(status != fmi2OK || pair->life.mode != STEPPING || same_bits(time, pair->life.time),
            "the last successful time is %.17g, not %.17g", time, pair->life.time);
    ASK(pair, legal, MAY_FAIL, GetIntegerStatus, kind, &whole);
    ASK(pair, legal, MAY_FAIL, GetBooleanStatus, kind, &logical);
    ASK(pair, legal, MAY_FAIL, GetStringStatus, kind, &text);
    REQUIRE(status != fmi2OK || text != NULL, "no text");
    ASK(pair, legal, MUST_FAIL, GetStatus, kind, NULL);
    ASK(pair, legal, MUST_FAIL, GetRealStatus, kind, NULL);
    ASK(pair, legal, MUST_FAIL, GetIntegerStatus, kind, NULL);
    ASK(pair, legal, MUST_FAIL, GetBooleanStatus, kind, NULL);
    ASK(pair, legal, MUST_FAIL, GetStringStatus, kind, NULL);
    REQUIRE(fmu.CancelStep(pair->main) == fmi2Error, "a step was cancelled");
}

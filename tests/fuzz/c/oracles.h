/* What is compared from time to time, and at the end. */

enum { TRACE_STEPS = 4, TRACE_SIZE = (TRACE_STEPS + 1) * VARIABLE_COUNT };

/** a variable as a double, whatever its type; the status of getting it */
static fmi2Status get_any(fmi2Component component, fmi2ValueReference vr, double *value)
{
    int whole = 0;
    fmi2Status status;
    *value = 0.0;
    if (variable_type[vr] == TYPE_REAL) {
        return fmu.GetReal(component, &vr, 1, value);
    }
    status = variable_type[vr] == TYPE_BOOLEAN ? fmu.GetBoolean(component, &vr, 1, &whole)
                                               : fmu.GetInteger(component, &vr, 1, &whole);
    *value = (double)whole;
    return status;
}

/** the whole memory of both instances, but for what only the one that was asked has worked out */
static void compare_saved(Pair *pair)
{
    fmi2FMUstate one = NULL, other = NULL;
    size_t size = 0;
    fmi2Byte *bytes, *others;
    REQUIRE(fmu.GetFMUstate(pair->main, &one) == fmi2OK && fmu.GetFMUstate(pair->shadow, &other) == fmi2OK, "no state");
    REQUIRE(fmu.SerializedFMUstateSize(pair->main, one, &size) == fmi2OK, "no size");
    bytes = block(size, 1);
    others = block(size, 1);
    REQUIRE(fmu.SerializeFMUstate(pair->main, one, bytes, size) == fmi2OK, "no bytes");
    REQUIRE(fmu.SerializeFMUstate(pair->shadow, other, others, size) == fmi2OK, "no bytes");
    for (size_t k = 0; k < size - 8; ++k) { /* the last word is the checksum of all */
        REQUIRE(bytes[k] == others[k], "byte %zu of the memory of two instances that were told the same differs", k);
    }
    free(bytes);
    free(others);
    REQUIRE(fmu.FreeFMUstate(pair->shadow, &one) == fmi2OK && fmu.FreeFMUstate(pair->main, &other) == fmi2OK, "no end");
}

/** both instances show the same bits */
static void compare_pair(Pair *pair)
{
    int all_there = 1;
    for (fmi2ValueReference vr = 0; vr < VARIABLE_COUNT; ++vr) {
        double value, other;
        const fmi2Status status = get_any(pair->main, vr, &value), others = get_any(pair->shadow, vr, &other);
        REQUIRE(status == others, "%s can be read: %d, and %d on a quiet instance", variable_name(vr), (int)status, (int)others);
        REQUIRE(status != fmi2OK || same_bits(value, other), "%s is %.17g, and %.17g on a quiet instance",
                variable_name(vr), value, other);
        REQUIRE(status != fmi2OK || isfinite(value), "%s is %g", variable_name(vr), value);
        all_there = all_there && status == fmi2OK;
    }
    if (pair->kind == fmi2ModelExchange && CONTINUOUS_STATES > 0 && (pair->life.mode & READABLE) != 0) {
        double x[STATE_SLOTS], y[STATE_SLOTS];
        fmi2Status status = fmu.GetContinuousStates(pair->main, x, CONTINUOUS_STATES);
        REQUIRE(status == fmu.GetContinuousStates(pair->shadow, y, CONTINUOUS_STATES), "states of one");
        REQUIRE(status != fmi2OK || memcmp(x, y, sizeof x) == 0, "other states");
        status = fmu.GetDerivatives(pair->main, x, CONTINUOUS_STATES);
        REQUIRE(status == fmu.GetDerivatives(pair->shadow, y, CONTINUOUS_STATES), "derivatives of one");
        REQUIRE(status != fmi2OK || memcmp(x, y, sizeof x) == 0, "other derivatives");
    }
    if (all_there) {
        compare_saved(pair);
    }
}

/* A simulation from the start values, the same whatever an instance has been through before its reset. */
static void trace(fmi2Component component, int kind, double *values)
{
    fmi2EventInfo info;
    REQUIRE(fmu.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == fmi2OK, "no setup");
    REQUIRE(fmu.EnterInitializationMode(component) == fmi2OK, "no start");
    REQUIRE(fmu.ExitInitializationMode(component) == fmi2OK, "no end of the start");
    for (int n = 0; n <= TRACE_STEPS; ++n) {
        for (fmi2ValueReference vr = 0; vr < VARIABLE_COUNT; ++vr) {
            REQUIRE(get_any(component, vr, values + n * VARIABLE_COUNT + (int)vr) == fmi2OK, "no value");
        }
        if (kind == fmi2CoSimulation) {
            REQUIRE(fmu.DoStep(component, 1e-3 * n, 1e-3, 1) <= fmi2Warning, "no step");
        } else {
            REQUIRE(fmu.NewDiscreteStates(component, &info) <= fmi2Warning, "no event");
            REQUIRE(fmu.EnterContinuousTimeMode(component) == fmi2OK, "no continuous time");
            REQUIRE(fmu.SetTime(component, 1e-3 * (n + 1)) == fmi2OK, "no time");
            REQUIRE(fmu.EnterEventMode(component) == fmi2OK, "no event mode");
        }
    }
}

static double traces[2][TRACE_SIZE]; /* by kind */

static void learn_trace(void)
{
    for (int kind = 0; kind < 2; ++kind) {
        const fmi2Type type = kind == 0 ? fmi2ModelExchange : fmi2CoSimulation;
        fmi2Component component = fmu.Instantiate("trace", type, MODEL_GUID, "", NULL, 0, 0);
        REQUIRE(component != NULL, "no instance");
        REQUIRE((int)fmi2ModelExchange == 0 && (int)fmi2CoSimulation == 1, "the kinds index traces");
        trace(component, (int)type, traces[type]);
        fmu.FreeInstance(component);
    }
}

/** every function without an instance: an error, no crash */
static void call_with_nothing(void)
{
    const fmi2ValueReference vr = 0;
    double real = 0.0;
    fmi2Integer whole = 0;
    fmi2String text = "";
    fmi2FMUstate state = NULL;
    fmi2Byte byte = 0;
    size_t size = 0;
    fmi2Status status;
    fmi2EventInfo info;
    REQUIRE(strcmp(fmu.GetVersion(), "2.0") == 0 && strcmp(fmu.GetTypesPlatform(), "default") == 0, "an odd version");
    fmu.FreeInstance(NULL);
    const fmi2Status answers[] = {
        fmu.SetDebugLogging(NULL, 1, 0, NULL), fmu.SetupExperiment(NULL, 0, 0.0, 0.0, 0, 0.0),
        fmu.EnterInitializationMode(NULL), fmu.ExitInitializationMode(NULL), fmu.Terminate(NULL), fmu.Reset(NULL),
        fmu.GetReal(NULL, &vr, 1, &real), fmu.GetInteger(NULL, &vr, 1, &whole), fmu.GetBoolean(NULL, &vr, 1, &whole),
        fmu.GetString(NULL, &vr, 1, &text), fmu.SetReal(NULL, &vr, 1, &real), fmu.SetInteger(NULL, &vr, 1, &whole),
        fmu.SetBoolean(NULL, &vr, 1, &whole), fmu.SetString(NULL, &vr, 1, &text), fmu.GetFMUstate(NULL, &state),
        fmu.SetFMUstate(NULL, state), fmu.FreeFMUstate(NULL, &state), fmu.SerializedFMUstateSize(NULL, state, &size),
        fmu.SerializeFMUstate(NULL, state, &byte, 1), fmu.DeSerializeFMUstate(NULL, &byte, 1, &state),
        fmu.GetDirectionalDerivative(NULL, &vr, 1, &vr, 1, &real, &real), fmu.EnterEventMode(NULL),
        fmu.NewDiscreteStates(NULL, &info), fmu.EnterContinuousTimeMode(NULL),
        fmu.CompletedIntegratorStep(NULL, 1, &whole, &whole), fmu.SetTime(NULL, 0.0), fmu.SetContinuousStates(NULL, &real, 1),
        fmu.GetDerivatives(NULL, &real, 1), fmu.GetEventIndicators(NULL, &real, 0), fmu.GetContinuousStates(NULL, &real, 1),
        fmu.GetNominalsOfContinuousStates(NULL, &real, 1), fmu.SetRealInputDerivatives(NULL, &vr, 1, &whole, &real),
        fmu.GetRealOutputDerivatives(NULL, &vr, 1, &whole, &real), fmu.DoStep(NULL, 0.0, 1e-3, 1), fmu.CancelStep(NULL),
        fmu.GetStatus(NULL, fmi2DoStepStatus, &status), fmu.GetRealStatus(NULL, fmi2LastSuccessfulTime, &real),
        fmu.GetIntegerStatus(NULL, fmi2DoStepStatus, &whole), fmu.GetBooleanStatus(NULL, fmi2Terminated, &whole),
        fmu.GetStringStatus(NULL, fmi2PendingStatus, &text)};
    for (size_t k = 0; k < sizeof answers / sizeof answers[0]; ++k) {
        REQUIRE(answers[k] == fmi2Error, "function %d takes no instance for an instance", (int)k);
    }
}

/** after reset everything is as new; and all memory is given back */
static void finish(void)
{
    double values[TRACE_SIZE];
    for (unsigned k = 0; k < PAIRS; ++k) {
        Pair *pair = &pairs[k];
        if (pair->main != NULL) {
            compare_pair(pair);
            REQUIRE(fmu.Reset(pair->main) == fmi2OK, "no reset");
            trace(pair->main, pair->kind, values);
            REQUIRE(memcmp(values, traces[pair->kind], sizeof values) == 0, "something outlives a reset");
        }
    }
    if (any_pair() == NULL) {
        input_size = 0; /* zeros from here: an instance without ado */
        call_instantiate(&pairs[0]);
    }
    for (unsigned k = 0; k < SAVED; ++k) {
        REQUIRE(fmu.FreeFMUstate(any_pair()->main, &saved[k].main) == fmi2OK, "no end of a state");
        REQUIRE(fmu.FreeFMUstate(any_pair()->main, &saved[k].shadow) == fmi2OK, "no end of a state");
    }
    for (unsigned k = 0; k < PAIRS; ++k) {
        call_free(&pairs[k]);
    }
    for (unsigned k = 0; k < STORED; ++k) {
        free(stored[k].main);
        free(stored[k].shadow);
    }
    memset(pairs, 0, sizeof pairs);
    memset(saved, 0, sizeof saved);
    memset(stored, 0, sizeof stored);
    REQUIRE(heap_balance == 0, "%ld blocks of memory are not given back", heap_balance);
}

/* Calls that set and get values. */

#define LEGAL_SET_REAL (BEFORE | STARTING | RUNNING)
#define LEGAL_SET_OTHER (BEFORE | STARTING | STEPPING | EVENTS)

/** what was set last is what is got */
static void check_set(Pair *pair, const References *some, const double *values)
{
    fmi2Status status;
    for (size_t k = 0; k < some->count; ++k) {
        double found = 0.0;
        int last = 1;
        for (size_t later = k + 1; later < some->count; ++later) {
            last = last && some->vr[later] != some->vr[k];
        }
        if (last && (pair->life.mode & READABLE) != 0) {
            ASK(pair, READABLE, MUST_WORK, GetReal, some->vr + k, 1, &found);
            REQUIRE(same_bits(found, values[k]), "%s was set to %.17g and is %.17g", variable_name(some->vr[k]),
                    values[k], found);
        }
    }
}

static void call_set_real(Pair *pair)
{
    References some = take_settable();
    double *values = take_chance(30) ? NULL : block(some.count, sizeof *values);
    fmi2Status status;
    for (size_t k = 0; values != NULL && some.vr != NULL && k < some.count; ++k) {
        values[k] = take_value(some.vr[k]);
    }
    if (some.vr == NULL && values != NULL) {
        memset(values, 0, some.count * sizeof *values);
    }
    TELL(pair, LEGAL_SET_REAL, promise_of_set(&some, values, TYPE_REAL, pair->life.mode), 0, SetReal, some.vr,
         some.count, values);
    if (status != fmi2Error && some.count > 0) {
        note_values(&pair->life, &some, values);
        check_set(pair, &some, values);
    }
    free(some.vr);
    free(values);
}

static void call_set_whole(Pair *pair)
{
    References some = take_settable();
    const int is_boolean = take_chance(3);
    const int types = is_boolean ? (int)TYPE_BOOLEAN : (int)WHOLE_TYPES;
    fmi2Integer *values = take_chance(30) ? NULL : block(some.count, sizeof *values);
    double *as_real = block(some.count, sizeof *as_real);
    fmi2Status status;
    for (size_t k = 0; k < some.count; ++k) {
        const unsigned choice = take();
        const int value = choice < 128 ? (int)choice % 6 : choice < 200 ? (int)choice - 164 : choice % 2 ? INT32_MIN : INT32_MAX;
        if (values != NULL) {
            values[k] = value;
        }
        as_real[k] = is_boolean ? (double)(value != 0) : (double)value;
    }
    if (is_boolean) {
        TELL(pair, LEGAL_SET_OTHER, promise_of_set(&some, values != NULL ? as_real : NULL, types, pair->life.mode), 0,
             SetBoolean, some.vr, some.count, values);
    } else {
        TELL(pair, LEGAL_SET_OTHER, promise_of_set(&some, values != NULL ? as_real : NULL, types, pair->life.mode), 0,
             SetInteger, some.vr, some.count, values);
    }
    if (status != fmi2Error && some.count > 0) {
        note_values(&pair->life, &some, as_real);
    }
    free(some.vr);
    free(values);
    free(as_real);
}

static void call_set_string(Pair *pair)
{
    References some = take_settable();
    fmi2String *values = block(some.count, sizeof *values);
    fmi2Status status;
    for (size_t k = 0; k < some.count; ++k) {
        values[k] = take() % 2 ? "text" : NULL;
    }
    TELL(pair, LEGAL_SET_OTHER, some.count > 0 ? MUST_FAIL : MAY_FAIL, 0, SetString, some.vr, some.count, values);
    free(some.vr);
    free((void *)values);
}

static void call_get_real(Pair *pair)
{
    References some = take_references(take_below(4) == 3 ? (int)CAUSALITY_INPUT : take() % 2 ? (int)CAUSALITY_OUTPUT : (int)CAUSALITY_LOCAL);
    double *values = take_chance(30) ? NULL : block(some.count, sizeof *values);
    double mark;
    fmi2Status status;
    memset(&mark, 0xa5, sizeof mark);
    for (size_t k = 0; values != NULL && k < some.count; ++k) {
        values[k] = mark;
    }
    ASK(pair, READABLE, are_known(&some, values, TYPE_REAL) ? MAY_FAIL : MUST_FAIL, GetReal, some.vr, some.count, values);
    for (size_t k = 0; values != NULL && k < some.count; ++k) {
        REQUIRE(status == fmi2OK ? isfinite(values[k]) : same_bits(values[k], mark),
                "GetReal answers %d and writes %.17g", (int)status, values[k]);
    }
    free(some.vr);
    free(values);
}

static void call_get_whole(Pair *pair)
{
    References some = take_references(take_below(3) == 2 ? (int)CAUSALITY_PARAMETER : (int)CAUSALITY_LOCAL);
    int *values = block(some.count, sizeof *values);
    fmi2Status status;
    memset(values, 0x5a, some.count * sizeof *values);
    if (take() % 2) {
        ASK(pair, READABLE, are_known(&some, values, WHOLE_TYPES) ? MAY_FAIL : MUST_FAIL, GetInteger, some.vr,
            some.count, values);
    } else {
        ASK(pair, READABLE, are_known(&some, values, TYPE_BOOLEAN) ? MAY_FAIL : MUST_FAIL, GetBoolean, some.vr,
            some.count, values);
        for (size_t k = 0; status == fmi2OK && k < some.count; ++k) {
            REQUIRE(values[k] == fmi2True || values[k] == fmi2False, "GetBoolean gives %d", values[k]);
        }
    }
    for (size_t k = 0; status != fmi2OK && k < some.count; ++k) {
        REQUIRE(values[k] == 0x5a5a5a5a, "a refused get writes %d", values[k]);
    }
    free(some.vr);
    free(values);
}

static void call_get_string(Pair *pair)
{
    References some = take_references(-1);
    fmi2String *values = block(some.count, sizeof *values);
    fmi2Status status;
    ASK(pair, READABLE, some.count > 0 ? MUST_FAIL : MAY_FAIL, GetString, some.vr, some.count, values);
    free(some.vr);
    free((void *)values);
}

static void call_directional_derivative(Pair *pair)
{
    References of = take_references(take() % 2 ? (int)CAUSALITY_OUTPUT : (int)CAUSALITY_LOCAL);
    References along = take_references(take_below(4) == 3 ? (int)CAUSALITY_PARAMETER : (int)CAUSALITY_INPUT);
    double *direction = block(along.count, sizeof *direction), *change = block(of.count, sizeof *change), mark;
    const int is_known = are_known(&of, change, TYPE_REAL) && are_known(&along, direction, TYPE_REAL);
    fmi2Status status;
    memset(&mark, 0xa5, sizeof mark);
    for (size_t k = 0; k < along.count; ++k) {
        direction[k] = take_chance(8) ? take_value(0) : 1.0;
    }
    for (size_t k = 0; k < of.count; ++k) {
        change[k] = mark;
    }
    ASK(pair, READABLE, is_known ? MAY_FAIL : MUST_FAIL, GetDirectionalDerivative, of.vr, of.count, along.vr, along.count,
        direction, change);
    for (size_t k = 0; k < of.count; ++k) {
        REQUIRE(status == fmi2OK ? isfinite(change[k]) : same_bits(change[k], mark),
                "GetDirectionalDerivative answers %d and writes %.17g", (int)status, change[k]);
    }
    free(of.vr);
    free(along.vr);
    free(direction);
    free(change);
}

static void call_slopes(Pair *pair)
{
    References some = take_references(CAUSALITY_INPUT);
    fmi2Integer *order = take_chance(30) ? NULL : block(some.count, sizeof *order);
    double *values = take_chance(30) ? NULL : block(some.count, sizeof *values);
    int promise = are_known(&some, values, TYPE_REAL) && (order != NULL || some.count == 0) ? MUST_WORK : MUST_FAIL;
    fmi2Status status;
    for (size_t k = 0; k < some.count; ++k) {
        if (order != NULL) {
            order[k] = take_chance(8) ? (int)take() - 100 : 1;
        }
        if (values != NULL) {
            values[k] = take_chance(16) ? DBL_MAX : take_chance(8) ? take_value(0) : 0.01 * ((double)take() - 128.0);
        }
        if (promise == MUST_WORK && (variable_causality[some.vr[k]] != CAUSALITY_INPUT || order[k] != 1 || !isfinite(values[k]))) {
            promise = MUST_FAIL;
        }
    }
    TELL(pair, legal_in(pair->kind, BEFORE | STARTING | STEPPING, 0), promise, 0, SetRealInputDerivatives, some.vr,
         some.count, order, values);
    if (status != fmi2Error && some.count > 0) {
        pair->life.given_slopes = 1;
        pair->life.tame = 0;
    }
    ASK(pair, legal_in(pair->kind, STEPPING | ENDED | BROKEN, 0), some.count > 0 ? MUST_FAIL : MAY_FAIL,
        GetRealOutputDerivatives, some.vr, some.count, order, values);
    free(some.vr);
    free(order);
    free(values);
}

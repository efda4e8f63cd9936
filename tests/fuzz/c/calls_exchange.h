/* Calls of model exchange. */

static void call_set_time(Pair *pair)
{
    Life *life = &pair->life;
    const double step = take_step();
    const double time = take_chance(8) ? life->event - 1.0 : life->time + step;
    const int right = step > 0.0 && step < 1.0 && time >= life->event && fabs(time) < 1e6;
    const int wrong = !isfinite(time) || (time < life->event - 0.5 && fabs(life->event) < 1e290);
    fmi2Status status;
    if (!wrong && time > life->event + 0.2 && time < 1e299) { /* thousands of ticks would be due */
        return;
    }
    TELL(pair, legal_in(pair->kind, 0, EVENTS | CONTINUOUS), wrong ? MUST_FAIL : right ? MUST_WORK : MAY_FAIL, 0, SetTime, time);
    if (status != fmi2Error) {
        life->time = time;
    }
}

static void call_enter_events(Pair *pair)
{
    const int legal = legal_in(pair->kind, 0, EVENTS | CONTINUOUS);
    const int promise = pair->life.time <= pair->life.stop ? MUST_WORK : MAY_FAIL;
    if (move(pair, fmu.EnterEventMode, "EnterEventMode", legal, promise, EVENTS) != fmi2Error) {
        pair->life.event = pair->life.time;
    }
}

static void call_discrete_states(Pair *pair)
{
    const int legal = legal_in(pair->kind, 0, EVENTS);
    const int works = pair->life.tame && CONTINUOUS_STATES == 0;
    fmi2EventInfo *info = take_chance(16) ? NULL : block(1, sizeof *info);
    fmi2Status status;
    if (info != NULL) {
        memset(info, 0x5a, sizeof *info);
    }
    TELL(pair, legal, info == NULL ? MUST_FAIL : works ? MUST_WORK : MAY_FAIL, 1, NewDiscreteStates, info);
    if (status == fmi2Error && pair->life.mode == EVENTS && info != NULL && legal != 0) {
        pair->life.mode = BROKEN;
    }
    if (status != fmi2Error) {
        REQUIRE(info->newDiscreteStatesNeeded == fmi2False && info->terminateSimulation == fmi2False &&
                    info->valuesOfContinuousStatesChanged == fmi2False,
                "odd event information");
        REQUIRE(info->nextEventTimeDefined == (CONTINUOUS_STATES == 0 ? fmi2True : fmi2False), "a time event of a kind");
        REQUIRE(!info->nextEventTimeDefined || info->nextEventTime > pair->life.time - 1e-4 || fabs(pair->life.time) > 1e6,
                "the next event at %.17g is over at %.17g", info->nextEventTime, pair->life.time);
    }
    free(info);
}

static void call_continue(Pair *pair)
{
    const int legal = legal_in(pair->kind, 0, EVENTS);
    if (move(pair, fmu.EnterContinuousTimeMode, "EnterContinuousTimeMode", legal,
             CONTINUOUS_STATES > 0 ? MUST_WORK : MAY_FAIL, CONTINUOUS) != fmi2Error) {
        pair->life.event = pair->life.time;
    }
}

/** the whole event: bytes seldom find the way */
static void call_event(Pair *pair)
{
    call_set_time(pair);
    call_enter_events(pair);
    call_discrete_states(pair);
    call_continue(pair);
}

static void call_completed_step(Pair *pair)
{
    const int legal = legal_in(pair->kind, 0, CONTINUOUS);
    fmi2Boolean enter = 77, end = 77;
    fmi2Status status;
    ASK(pair, legal, pair->life.time <= pair->life.stop ? MUST_WORK : MAY_FAIL, CompletedIntegratorStep, 1, &enter, &end);
    REQUIRE(status == fmi2Error || ((enter == fmi2True || enter == fmi2False) && end == fmi2False), "an odd answer");
    ASK(pair, legal, MUST_FAIL, CompletedIntegratorStep, 1, NULL, &end);
    ASK(pair, legal, MUST_FAIL, CompletedIntegratorStep, 1, &enter, NULL);
}

static void call_set_states(Pair *pair)
{
    const int is_odd = take_chance(8);
    const size_t count = is_odd ? take_below(12) : CONTINUOUS_STATES;
    double *states = take_chance(30) ? NULL : block(count, sizeof *states);
    int promise = count == CONTINUOUS_STATES && (states != NULL || count == 0) ? MUST_WORK : MUST_FAIL;
    fmi2Status status = fmi2Error;
    if (states != NULL && count == CONTINUOUS_STATES) {
        memset(states, 0, count * sizeof *states);
        (void)fmu.GetContinuousStates(pair->main, states, count);
    }
    for (size_t k = 0; states != NULL && k < count; ++k) {
        const unsigned choice = take();
        const double base = count == CONTINUOUS_STATES && isfinite(states[k]) ? states[k] : 0.0;
        states[k] = choice < 240 ? base + 1e-4 * ((double)choice - 120.0) : take_value(0);
        if (!isfinite(states[k])) {
            promise = MUST_FAIL;
        }
    }
    TELL(pair, legal_in(pair->kind, 0, CONTINUOUS), promise, 0, SetContinuousStates, states, count);
    free(states);
}

static void call_get_indicators(Pair *pair)
{
    const int legal = legal_in(pair->kind, 0, READABLE);
    const int right = EVENT_INDICATORS == 0 ? MUST_WORK : MAY_FAIL; /* a model that cannot start has none */
    const size_t count = EVENT_INDICATORS;
    double *found = block(count, sizeof *found);
    fmi2Status status;
    ASK(pair, legal, right, GetEventIndicators, found, count);
    for (size_t k = 0; status == fmi2OK && k < count; ++k) {
        REQUIRE(isfinite(found[k]), "an event indicator is %g", found[k]);
    }
    free(found);
    ASK(pair, legal, EVENT_INDICATORS == 0 ? MUST_WORK : MUST_FAIL, GetEventIndicators, NULL, EVENT_INDICATORS);
    ASK(pair, legal, MUST_FAIL, GetEventIndicators, NULL, EVENT_INDICATORS + 1 + take_below(3));
}

static void call_get_states(Pair *pair)
{
    const size_t count = take_chance(8) ? take_below(12) : CONTINUOUS_STATES;
    const int promise = count == CONTINUOUS_STATES ? MAY_FAIL : MUST_FAIL;
    double *found = block(count, sizeof *found);
    fmi2Status status;
    ASK(pair, legal_in(pair->kind, 0, READABLE), promise, GetContinuousStates, found, count);
    for (size_t k = 0; status == fmi2OK && k < count; ++k) {
        REQUIRE(isfinite(found[k]), "a state is %g", found[k]);
    }
    ASK(pair, legal_in(pair->kind, 0, READABLE), promise, GetDerivatives, found, count);
    for (size_t k = 0; status == fmi2OK && k < count; ++k) {
        REQUIRE(isfinite(found[k]), "a derivative is %g", found[k]);
    }
    ASK(pair, legal_in(pair->kind, 0, ALWAYS), promise == MUST_FAIL ? MUST_FAIL : MUST_WORK,
        GetNominalsOfContinuousStates, found, count);
    for (size_t k = 0; status == fmi2OK && k < count; ++k) {
        REQUIRE(found[k] > 0.0 && isfinite(found[k]), "a nominal is %g", found[k]);
    }
    free(found);
    if (CONTINUOUS_STATES > 0) {
        ASK(pair, legal_in(pair->kind, 0, READABLE), MUST_FAIL, GetContinuousStates, NULL, CONTINUOUS_STATES);
        ASK(pair, legal_in(pair->kind, 0, READABLE), MUST_FAIL, GetDerivatives, NULL, CONTINUOUS_STATES);
    }
    call_get_indicators(pair);
}

/* Values and value references: right ones, and every kind of wrong one. */

enum { REFERENCES = VARIABLE_COUNT + 2, WHOLE_TYPES = TYPE_INTEGER | TYPE_ENUMERATION };

/** a value for a variable: inside its limits, at them, beyond them, or no number */
static double take_value(fmi2ValueReference vr)
{
    static const double odd[] = {0.0, -0.0, DBL_MAX, -DBL_MAX, 5e-324, 1e-310, 1e9, -1e9, 1e150, 1e300};
    const int known = vr < VARIABLE_COUNT;
    const double start = known ? variable_start[vr] : 1.0;
    const double low = known ? variable_minimum[vr] : -1.0, high = known ? variable_maximum[vr] : 1.0;
    const double width = low > -1e300 && high < 1e300 ? high - low : 0.2 * fabs(start) + 1e-3;
    const unsigned choice = take();
    if (choice < 96) {
        const double near = start + width * 0.002 * ((double)choice - 48.0);
        return near < low ? low : near > high ? high : near;
    }
    if (choice < 192) {
        return low > -1e300 && high < 1e300 ? low + width * (double)(choice - 96) / 96.0 : start;
    }
    switch (choice % 8) {
    case 0:
        return low;
    case 1:
        return high;
    case 2:
        return high + width;
    case 3:
        return low - width;
    case 4:
        return take() % 2 ? NAN : take() % 2 ? INFINITY : -INFINITY;
    case 5:
        return odd[take_below(sizeof odd / sizeof odd[0])];
    case 6:
        return take_raw_double();
    default:
        return start;
    }
}

/** a value reference, most often of a variable of this causality (-1: any) */
static fmi2ValueReference take_reference(int causality)
{
    const unsigned first = take();
    const fmi2ValueReference odd[] = {VARIABLE_COUNT, VARIABLE_COUNT + 1, 0x7fffffffU, 0x80000000U, 0xffffffffU};
    if (first >= 248) {
        return odd[first % 5];
    }
    for (unsigned k = 0; k < VARIABLE_COUNT && causality >= 0; ++k) {
        const unsigned vr = (first + k) % VARIABLE_COUNT;
        if (variable_causality[vr] == causality) {
            return vr;
        }
    }
    return first % VARIABLE_COUNT;
}

typedef struct {
    size_t count;
    fmi2ValueReference *vr; /* a block of its own, or NULL */
} References;

static References take_references(int causality)
{
    const unsigned choice = take();
    References found = {choice < 250 ? choice % 4U : VARIABLE_COUNT, NULL};
    if (choice >= 245 && choice < 250) {
        return found; /* NULL, of some length */
    }
    found.vr = block(found.count, sizeof *found.vr);
    for (size_t k = 0; k < found.count; ++k) {
        found.vr[k] = choice == 255 ? (fmi2ValueReference)k : take_reference(take_chance(4) ? -1 : causality);
    }
    return found;
}

/** an input, mostly; a parameter one time in three */
static References take_settable(void)
{
    return take_references(take_below(3) == 0 ? CAUSALITY_PARAMETER : CAUSALITY_INPUT);
}

/** whether all are variables of these types, and there is an array if they are any */
static int are_known(const References *some, const void *values, int types)
{
    if (some->count > 0 && (some->vr == NULL || values == NULL)) {
        return 0;
    }
    for (size_t k = 0; k < some->count; ++k) {
        if (some->vr[k] >= VARIABLE_COUNT || (variable_type[some->vr[k]] & types) == 0) {
            return 0;
        }
    }
    return 1;
}

/** whether a variable may take a value in a mode, whatever the model says of it */
static int is_settable(fmi2ValueReference vr, double value, int mode)
{
    const int causality = variable_causality[vr], variability = variable_variability[vr];
    if (value - value != 0.0 || (causality != CAUSALITY_INPUT && causality != CAUSALITY_PARAMETER)) {
        return 0;
    }
    if (causality == CAUSALITY_PARAMETER &&
        ((variability == VARIABILITY_FIXED && (mode & RUNNING) != 0) || value < variable_minimum[vr] ||
         value > variable_maximum[vr])) {
        return 0;
    }
    return mode != CONTINUOUS || variability == VARIABILITY_CONTINUOUS;
}

/** what setting these values must come to */
static int promise_of_set(const References *some, const double *values, int types, int mode)
{
    int promise = MUST_WORK;
    if (!are_known(some, values, types)) {
        return MUST_FAIL;
    }
    for (size_t k = 0; k < some->count; ++k) {
        if (mode != UNKNOWN && !is_settable(some->vr[k], values[k], mode)) {
            return MUST_FAIL;
        }
        if (variable_causality[some->vr[k]] == CAUSALITY_PARAMETER && (mode & (RUNNING | UNKNOWN)) != 0) {
            promise = MAY_FAIL; /* the model may have no tables for them */
        }
    }
    return mode == UNKNOWN ? MAY_FAIL : promise;
}

/** remember whether anything has left its limits, or the parameters of the start */
static void note_values(Life *life, const References *some, const double *values)
{
    for (size_t k = 0; k < some->count; ++k) {
        const fmi2ValueReference vr = some->vr[k];
        if (variable_causality[vr] == CAUSALITY_PARAMETER ? values[k] != variable_start[vr]
                                                          : values[k] < variable_minimum[vr] ||
                                                                values[k] > variable_maximum[vr]) {
            life->tame = 0;
        }
    }
}

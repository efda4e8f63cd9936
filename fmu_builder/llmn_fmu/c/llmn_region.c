/* The trained region of a network in its FMU: what inputs outside do, and what is said of them. */

enum { LLMN_FIRST_OUTPUT = TABLES_INPUTS, ALARM_CERTIFICATE = 1, ALARM_REGION = 2 };

/** message + "NAME = value is outside [low, high] at t = time s" for a limit numbered as in region.c */
static COLD void region_append(Message *message, int left, double value, double time)
{
    const int input = left - REGION_INPUT, derived = left - REGION_DERIVED(&tables);
    if (input < TABLES_INPUTS) {
        message_append_outside(message, variable_name(input), value, tables.input_minimum[input],
                               tables.input_maximum[input]);
    } else if (derived < 0) {
        const double rate = tables.trained_move / TABLES_SAMPLE_TIME;
        message_append(message, "the rate of ");
        message_append_outside(message, variable_name(TABLES_SCHEDULING), value / TABLES_SAMPLE_TIME, -rate, rate);
    } else {
        message_append_outside(message, variable_name(LLMN_FIRST_OUTPUT + TABLES_OUTPUTS + derived), value,
                               tables.derived_minimum[derived], tables.derived_maximum[derived]);
    }
    message_append(message, " at t = ");
    message_append_number(message, time);
    message_append(message, " s");
}

/** a limit is left: the first time it is remembered; 1 with a message where the importer wants an error of it. Inputs are
    the importer's, forces the model's own answer: they are told only */
static COLD int region_leave(Options *options, int left, double value, double time, Message *message)
{
    if (options->policy == POLICY_ERROR && left < REGION_DERIVED(&tables)) {
        region_append(message, left, value, time);
        message_append(message, ": keep to what was trained, or set out_of_range to warn or clamp");
        return 1;
    }
    if (options->left == REGION_KEPT) {
        options->left = left;
        options->value = value;
        options->time = time;
    }
    return 0;
}

/** message + what was left first, and what comes of it */
static COLD void region_tell(const Options *options, Message *message)
{
    region_append(message, (int)options->left, options->value, options->time);
    message_append(message, options->policy == POLICY_CLAMP && (int)options->left < REGION_DERIVED(&tables)
                                ? ": the limit acts in its place (reported once)"
                                : ": the model extrapolates (reported once)");
}

/* One FMI instance: the slave with its caller's logger, the guards every FMI function starts with, and the rules for
   getting and setting one variable. */

enum { LOG_ERROR = 1, LOG_WARNING = 2, LOG_DISCARD = 4, LOG_EVENT = 8, LOG_ALL = 15, NAME_CAPACITY = 128 };

typedef struct {
    Slave slave;
    fmi2CallbackLogger logger; /* may be NULL */
    fmi2ComponentEnvironment environment;
    const char *function; /* the FMI function that was called last: messages begin with its name */
    fmi2Status last_step;
    unsigned logged; /* LOG_ bits */
    char name[NAME_CAPACITY];
    unsigned char warned[VARIABLE_COUNT];
    unsigned char warned_of_events;
    unsigned char warned_of_parameters;
    unsigned warned_of_ticks; /* bits of model_alarms */
    /* Room to work in for one call: frames on the stack stay below a page, because Windows asks a library to probe larger
       ones, and how large these are depends on the model. */
    double before[VARIABLE_COUNT], direction[VARIABLE_COUNT], change[VARIABLE_COUNT];
    double work[MODEL_WORK];
} Instance;

/* In which modes a function may be called (FMI 2.0.4, sections 3.2.3 and 4.2.4), and on instances for what. */
enum {
    ONLY_MODEL_EXCHANGE = 256,
    ONLY_CO_SIMULATION = 512,
    MODE_RUNNING = MODE_STEP | MODE_EVENT | MODE_CONTINUOUS,
    MODE_READABLE = MODE_INITIALISATION | MODE_RUNNING | MODE_TERMINATED | MODE_FAILED,
    LEGAL_SetDebugLogging = MODE_ANY,
    LEGAL_SetupExperiment = MODE_INSTANTIATED,
    LEGAL_EnterInitializationMode = MODE_INSTANTIATED,
    LEGAL_ExitInitializationMode = MODE_INITIALISATION,
    LEGAL_Terminate = MODE_RUNNING,
    LEGAL_Reset = MODE_ANY,
    LEGAL_Get = MODE_READABLE,
    LEGAL_SetReal = MODE_INSTANTIATED | MODE_INITIALISATION | MODE_RUNNING,
    LEGAL_SetDiscrete = LEGAL_SetReal - MODE_CONTINUOUS,
    LEGAL_SetFixed = MODE_INSTANTIATED | MODE_INITIALISATION,
    LEGAL_State = MODE_ANY,
    LEGAL_GetDirectionalDerivative = MODE_READABLE,
    LEGAL_SetRealInputDerivatives = ONLY_CO_SIMULATION | MODE_INSTANTIATED | MODE_INITIALISATION | MODE_STEP,
    LEGAL_GetRealOutputDerivatives = ONLY_CO_SIMULATION | MODE_STEP | MODE_TERMINATED | MODE_FAILED,
    LEGAL_DoStep = ONLY_CO_SIMULATION | MODE_STEP,
    LEGAL_CancelStep = ONLY_CO_SIMULATION, /* no step is ever left unfinished */
    LEGAL_GetStatus = ONLY_CO_SIMULATION | MODE_STEP | MODE_TERMINATED | MODE_FAILED,
    LEGAL_EnterEventMode = ONLY_MODEL_EXCHANGE | MODE_EVENT | MODE_CONTINUOUS,
    LEGAL_NewDiscreteStates = ONLY_MODEL_EXCHANGE | MODE_EVENT,
    LEGAL_EnterContinuousTimeMode = ONLY_MODEL_EXCHANGE | MODE_EVENT,
    LEGAL_CompletedIntegratorStep = ONLY_MODEL_EXCHANGE | MODE_CONTINUOUS,
    LEGAL_SetTime = ONLY_MODEL_EXCHANGE | MODE_EVENT | MODE_CONTINUOUS,
    LEGAL_SetContinuousStates = ONLY_MODEL_EXCHANGE | MODE_CONTINUOUS,
    LEGAL_GetContinuousStates = ONLY_MODEL_EXCHANGE | MODE_READABLE,
    LEGAL_GetEventIndicators = ONLY_MODEL_EXCHANGE | MODE_READABLE,
    /* The derivatives at the start are initial unknowns, so they can be read there. */
    LEGAL_GetDerivatives = ONLY_MODEL_EXCHANGE | MODE_READABLE,
    LEGAL_GetNominalsOfContinuousStates = ONLY_MODEL_EXCHANGE | MODE_ANY
};

static COLD const char *mode_name(int64_t mode)
{
    unsigned k = 0;
    while ((int)mode != 1 << k) {
        ++k;
    }
    return text_at("before initialisation\0in initialisation mode\0between communication steps\0after termination\0"
                   "after an error of the model\0in event mode\0in continuous-time mode",
                   k);
}

static const char *purpose_name(int64_t purpose)
{
    return purpose == FOR_MODEL_EXCHANGE ? "model exchange" : "co-simulation";
}

/* The log categories that modelDescription.xml lists, and what each stands for. */
static const struct {
    char name[20];
    unsigned kinds;
} log_categories[] = {{"logAll", LOG_ALL},
                      {"logEvents", LOG_EVENT},
                      {"logStatusDiscard", LOG_DISCARD},
                      {"logStatusError", LOG_ERROR},
                      {"logStatusWarning", LOG_WARNING}};
enum { LOG_CATEGORIES = sizeof log_categories / sizeof log_categories[0] };

/** hand "function: message" to the caller's logger, if its category is wanted; returns the status */
static COLD fmi2Status instance_log(const Instance *instance, fmi2Status status, const Message *message)
{
    const unsigned kind = status == fmi2Error     ? LOG_ERROR
                          : status == fmi2Discard ? LOG_DISCARD
                          : status == fmi2Warning ? LOG_WARNING
                                                  : LOG_EVENT;
    Message whole;
    if (instance->logger != NULL && (instance->logged & kind) != 0) {
        const char *category = log_categories[0].name;
        for (unsigned k = 0; k < LOG_CATEGORIES; ++k) {
            category = log_categories[k].kinds == kind ? log_categories[k].name : category;
        }
        message_clear(&whole);
        message_append(&whole, instance->function);
        message_append(&whole, ": ");
        message_append(&whole, message->text);
        instance->logger(instance->environment, instance->name, status, category, whole.text);
    }
    return status;
}

/** log message + text as an error */
static COLD fmi2Status instance_error(const Instance *instance, Message *message, const char *text)
{
    message_append(message, text);
    return instance_log(instance, fmi2Error, message);
}

/** log message as a warning. The call is served: some importers take fmi2Warning from a setter for a refusal and end the
    run, so only the logger is told */
static COLD fmi2Status instance_warn(const Instance *instance, const Message *message)
{
    (void)instance_log(instance, fmi2Warning, message);
    return fmi2OK;
}

/** log message + text: where an integrator asks, a smaller step may help, otherwise it is an error */
static COLD fmi2Status instance_refuse(const Instance *instance, Message *message, const char *text)
{
    message_append(message, text);
    return instance_log(instance, instance->slave.mode == MODE_CONTINUOUS ? fmi2Discard : fmi2Error, message);
}

/** refuse a call that is not allowed on this instance, or not now */
static COLD Instance *instance_forbid(const Instance *instance, Message *message, const char *what, const char *which)
{
    message_append(message, what);
    (void)instance_error(instance, message, which);
    return NULL;
}

/** the instance if `function` may be called on it now, with an empty message, else NULL after an error message */
static APART Instance *instance_of(fmi2Component component, int legal, const char *function, Message *message)
{
    Instance *instance = (Instance *)component;
    message_clear(message);
    if (instance == NULL) {
        return NULL;
    }
    instance->function = function;
    if ((legal & (instance->slave.purpose == FOR_MODEL_EXCHANGE ? ONLY_CO_SIMULATION : ONLY_MODEL_EXCHANGE)) != 0) {
        return instance_forbid(instance, message, "not allowed on an instance for ",
                               purpose_name(instance->slave.purpose));
    }
    if ((instance->slave.mode & legal) == 0) {
        return instance_forbid(instance, message, "not allowed ", mode_name(instance->slave.mode));
    }
    return instance;
}

/** whether vr[0..count) are variables of one of `types`; otherwise an error message has been logged */
static int instance_knows(const Instance *instance, const fmi2ValueReference vr[], size_t count, const void *values,
                          int types, Message *message)
{
    if (count > 0 && (vr == NULL || values == NULL)) {
        (void)instance_error(instance, message, "an array is missing (NULL)");
        return 0;
    }
    for (size_t k = 0; k < count; ++k) {
        if (vr[k] >= VARIABLE_COUNT) {
            message_append(message, "unknown value reference ");
            message_append_integer(message, (long long)vr[k]);
            (void)instance_error(instance, message, "");
            return 0;
        }
        if ((variable_type[vr[k]] & types) == 0) {
            message_append(message, variable_name(vr[k]));
            (void)instance_error(instance, message, " has another type");
            return 0;
        }
    }
    return 1;
}

/** bring the values of vr[0..count) up to date; they are finite when it returns fmi2OK, else a message was logged */
static fmi2Status instance_prepare(Instance *instance, const fmi2ValueReference vr[], size_t count, Message *message)
{
    for (size_t k = 0; k < count; ++k) {
        const int given = variable_causality[vr[k]] == CAUSALITY_INPUT ||
                          variable_causality[vr[k]] == CAUSALITY_PARAMETER ||
                          variable_variability[vr[k]] == VARIABILITY_CONSTANT;
        if (!given && slave_prepare_outputs(&instance->slave, message) != 0) {
            return instance_refuse(instance, message, "");
        }
        if (!is_finite(instance->slave.values[vr[k]])) {
            message_append(message, variable_name(vr[k]));
            return instance_refuse(instance, message, " is not a finite number");
        }
    }
    return fmi2OK;
}

/** fmi2OK if vr[0..count) can be read now from the component's values[], otherwise a message has been logged */
static fmi2Status instance_to_read(fmi2Component component, const fmi2ValueReference vr[], size_t count,
                                   const void *values, int types, const char *function)
{
    Message message;
    Instance *instance = instance_of(component, LEGAL_Get, function, &message);
    if (instance == NULL || !instance_knows(instance, vr, count, values, types, &message)) {
        return fmi2Error;
    }
    return instance_prepare(instance, vr, count, &message);
}

static int is_outside(fmi2ValueReference vr, double value)
{
    return value < variable_minimum[vr] || value > variable_maximum[vr];
}

/** whether variable vr may take this value now; otherwise an error message has been logged */
static SMALL int instance_accepts(const Instance *instance, fmi2ValueReference vr, double value, Message *message)
{
    const int causality = variable_causality[vr];
    const int is_parameter = causality == CAUSALITY_PARAMETER;
    if (causality != CAUSALITY_INPUT && !is_parameter) {
        message_append(message, variable_name(vr));
        message_append(message, " is neither an input nor a parameter and cannot be set");
    } else if (is_parameter && variable_variability[vr] == VARIABILITY_FIXED &&
               (instance->slave.mode & LEGAL_SetFixed) == 0) {
        message_append(message, variable_name(vr));
        message_append(message, " is a fixed parameter and can only be set before initialisation ends");
    } else if (instance->slave.mode == MODE_CONTINUOUS && variable_variability[vr] != VARIABILITY_CONTINUOUS) {
        message_append(message, variable_name(vr));
        message_append(message, is_parameter ? " is a tunable parameter" : " is discrete");
        message_append(message, " and can only be set in event mode");
    } else if (!is_finite(value)) {
        message_append(message, variable_name(vr));
        message_append(message, " must be a finite number");
    } else if (is_parameter && is_outside(vr, value)) {
        message_append_outside(message, variable_name(vr), value, variable_minimum[vr], variable_maximum[vr]);
    } else {
        return 1;
    }
    (void)instance_error(instance, message, "");
    return 0;
}

/** after a value was set: an input outside its range is served, with one warning in the life of the instance */
static void instance_report(Instance *instance, fmi2ValueReference vr, double value)
{
    Message message;
    if (MODEL_WATCHES_INPUTS || !is_outside(vr, value) || instance->warned[vr]) {
        return;
    }
    instance->warned[vr] = 1;
    message_clear(&message);
    message_append_outside(&message, variable_name(vr), value, variable_minimum[vr], variable_maximum[vr]);
    message_append(&message, ": the model extrapolates (reported once)");
    (void)instance_warn(instance, &message);
}

/** whether a parameter is among vr[0..count) */
static int instance_has_parameters(const fmi2ValueReference vr[], size_t count)
{
    for (size_t k = 0; PARAMETER_COUNT > 0 && k < count; ++k) {
        if (variable_causality[vr[k]] == CAUSALITY_PARAMETER) {
            return 1;
        }
    }
    return 0;
}

/** after parameters were set: a running model takes them, or all values are those in before[] again and an error is
    logged; what the model remarks is logged once */
static COLD fmi2Status instance_parameters_set(Instance *instance)
{
    Message message;
    const char *remark = model_remark(instance->slave.values);
    message_clear(&message);
    if ((instance->slave.mode & MODE_RUNNING) != 0 && slave_retune(&instance->slave, &message) != 0) {
        for (unsigned k = 0; k < VARIABLE_COUNT; ++k) {
            instance->slave.values[k] = instance->before[k];
        }
        return instance_error(instance, &message, ": the values are those before");
    }
    if (remark == NULL || instance->warned_of_parameters) {
        return fmi2OK;
    }
    instance->warned_of_parameters = 1;
    message_append(&message, remark);
    return instance_warn(instance, &message);
}

/** log what the model has to tell, each thing once */
static COLD void instance_tell(Instance *instance, unsigned alarms)
{
    Message message;
    instance->warned_of_ticks |= alarms;
    for (unsigned alarm = 1; alarms != 0; alarm *= 2) {
        if ((alarms & alarm) != 0) {
            message_clear(&message);
            model_tell(&instance->slave.model, alarm, &message);
            (void)instance_log(instance, fmi2Warning, &message);
        }
        alarms &= ~alarm;
    }
}

/** after the start and after ticks: what they give rise to is logged once; the call itself was served */
static void instance_ticked(Instance *instance)
{
    const unsigned alarms = model_alarms(&instance->slave.model) & ~instance->warned_of_ticks;
    if (alarms != 0) {
        instance_tell(instance, alarms);
    }
}

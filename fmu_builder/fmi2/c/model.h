/* What a model must provide so that slave.c can run it. Everything is static: an FMU is one translation unit (all.c)
   that includes, in this order: elementary.c if used, message.c, generated data, variables.h (generated), the model,
   slave.c, functions.c. Included by slave.c, after the model, so that the compiler compares.

   Model: a flat struct without pointers whose members are all 8 bytes wide (double, int64_t, or arrays of them), so
   that it has no padding and its serialised form is the same on every platform. It is zeroed when an
   instance is made or reset. Everything that changes lives in it; the model has no other memory.

   A model without continuous states is sampled: in co-simulation and in model exchange alike, the ticks are all that
   happens to it. A model with continuous states is integrated by the importer in model exchange, and by model_tick in
   co-simulation.

   values[]: VARIABLE_COUNT doubles, indexed by value reference (VARIABLE_name), inputs first; Integer, Boolean and
   Enumeration values are exact doubles. inputs[]: its first INPUT_COUNT entries. The slave guarantees that they are
   finite. Functions that return int return 0 when they succeed and 1 with a message otherwise. */
#ifndef MODEL_H
#define MODEL_H

/** take the parameters from values[], each inside its limits; called before model_initialise, which is to give the same
    whatever an earlier initialisation has left in the model */
static int model_set_parameters(Model *model, const double *values, Message *message);

/** take changed tunable parameters from values[] while the model runs: what moves goes on from where it is. When it
    refuses, the model computes as before; the slave puts the old values back */
static int model_retune(Model *model, const double *values, Message *message);

/** NULL, or what is to be said once when somebody has given parameters these values[] */
static const char *model_remark(const double *values);

/* MODEL_WATCHES_INPUTS, a constant of the model: 1 when model_alarms tells of inputs outside their limits, which the slave
   then does not. */

/** one bit for each thing that is to be said once, as a warning, about the start and the ticks; asked after every step, so
    they stay */
static unsigned model_alarms(const Model *model);

/** message + what is to be said about one bit of model_alarms */
static void model_tell(const Model *model, unsigned alarm, Message *message);

/** the tick T_s, s: positive and constant after model_set_parameters */
static double model_sample_time(const Model *model);

/** steady state of the inputs; time is the start, s */
static int model_initialise(Model *model, double time, const double *inputs, Message *message);

/** ticks of a communication step or an event are about to come: an output that tells of all of them counts from here */
static void model_step_begins(Model *model);

/** t_n -> t_n+1 with the inputs in force at t_n = time, s */
static int model_tick(Model *model, double time, const double *inputs, Message *message);

/** outputs and locals in values[] from the state and from the inputs and parameters that stand in values[] */
static void model_outputs(const Model *model, double *values);

/** put the continuous states in place, CONTINUOUS_STATES finite numbers; never called when there are none */
static void model_set_states(Model *model, const double *states);

/** whether outputs and derivatives exist for the continuous states as set and the inputs; never called without any */
static int model_check_states(const Model *model, const double *inputs, Message *message);

/** EVENT_INDICATORS numbers for the states as set and the inputs and parameters in values[]: a change of sign is a state
    event, where the right-hand side has a kink. The right-hand side itself does not wait for the event: it holds on both
    sides. Numbers for any finite states and inputs; called after model_initialise, never when there are none */
static void model_event_indicators(const Model *model, const double *values, double *indicators);

/** exact derivative along a line: change[] of continuous outputs and state derivatives for the direction[] of inputs
    and continuous states, both VARIABLE_COUNT numbers by value reference; change[] is zero before. Called when
    model_check_states is content. */
static void model_directional_derivative(const Model *model, const double *values, const double *direction,
                                         double *change);

/** the same at the start, where outputs and states are steady states: change[] for the direction[] of inputs and Real
    parameters. Called after model_initialise, for the same values[]. work[] is room for MODEL_WORK numbers, a positive
    constant of the model */
static int model_start_derivative(const Model *model, const double *values, const double *direction, double *change,
                                  double *work, Message *message);

#endif

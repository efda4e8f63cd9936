/* The kinds of variables that the generated variables.h speaks of. One bit per type: functions take a set of them. */
#ifndef VARIABLE_KINDS_H
#define VARIABLE_KINDS_H

enum { TYPE_REAL = 1, TYPE_INTEGER = 2, TYPE_BOOLEAN = 4, TYPE_ENUMERATION = 8 };
enum { CAUSALITY_INPUT, CAUSALITY_PARAMETER, CAUSALITY_OUTPUT, CAUSALITY_LOCAL };
enum { VARIABILITY_CONSTANT, VARIABILITY_FIXED, VARIABILITY_TUNABLE, VARIABILITY_DISCRETE, VARIABILITY_CONTINUOUS };

/* A continuous state of model exchange: value references of the state and of its time derivative, typical size. */
typedef struct {
    unsigned state;
    unsigned derivative;
    double nominal;
} ContinuousState;

#endif

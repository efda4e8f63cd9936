/* What an FMU of a network is told beside its inputs, and what it remembers of the first limit of its trained region that was
   left; part of every Model. */

#include <stdint.h>

enum { POLICY_WARN = 1, POLICY_CLAMP = 2, POLICY_ERROR = 3 }; /* items of the variable out_of_range */

typedef struct {
    double unilateral; /* 1.0: the pan-head may leave the wire */
    int64_t policy;    /* POLICY_... */
    int64_t left;      /* the first limit that was left since the start, numbered as in region.c; 0: none */
    double value;      /* what lay outside */
    double time;       /* when, s */
} Options;

/** as before any limit was left: a start leaves no trace of starts before it */
static void options_forget(Options *options)
{
    options->left = 0;
    options->value = 0.0;
    options->time = 0.0;
}

/** what the importer has set, from values[] */
static void options_set(Options *options, const double *values)
{
    options->unilateral = CONTACT_SWITCH >= 0 ? values[CONTACT_SWITCH] : 0.0;
    options->policy = (int64_t)values[VARIABLE_out_of_range];
}

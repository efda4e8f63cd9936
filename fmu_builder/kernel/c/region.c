/* The region that training data cover; included by kernel.c. It has a limit for
     every input: smallest and largest value, of the scheduling input within the range;
     the scheduling input's move from tick to tick;
     derived outputs: smallest and largest value,
   and a tick lies in it when all of them are kept when the tick begins: by the inputs in force, and by the derived outputs of
   the state and these inputs, which is what a row of the data holds. No limit has a margin.

   With limited inputs those beyond their limits are held there, and the scheduling input follows no faster than it has moved
   in training. A contact (contact.c) then acts on what is left of them; it is no limit, and moves are counted before it. */

/* What is left: nothing, input 0 .. m - 1, the move, derived output 0 .. R - 1. */
enum { REGION_KEPT = 0, REGION_INPUT = 1 };
#define REGION_MOVE(t) (REGION_INPUT + FIXED(t, inputs))
#define REGION_DERIVED(t) (REGION_MOVE(t) + 1)

/* The first limit that is left, with the value that does; inputs as given, and as they act on outputs. The state stays. */
static inline int kernel_left(
    const Tables *t, const double *state, const double *given, const double *acting, double *value) {
    KernelView v = kernel_view(t, (double *)state);
    const double *outputs = v.held;
    int i, j;
    for (j = 0; j < FIXED(t, inputs); ++j) {
        *value = given[j];
        if (!(*value >= t->input_minimum[j] && *value <= t->input_maximum[j])) return REGION_INPUT + j;
    }
    *value = given[FIXED(t, scheduling)] - v.scheduling_given[0];
    if (*value > FIXED(t, trained_move) || *value < -FIXED(t, trained_move)) return REGION_MOVE(t);
    if (!FIXED(t, watched)) return REGION_KEPT;
    if (FIXED(t, feedthrough)) {
        kernel_present(t, &v, acting, v.product); /* scratch */
        outputs = v.product;
    }
    for (i = 0; i < FIXED(t, derived); ++i) {
        *value = kernel_derived(t, i, outputs, acting);
        if (*value < t->derived_minimum[i] || *value > t->derived_maximum[i]) return REGION_DERIVED(t) + i;
    }
    return REGION_KEPT;
}

/* What a tick, or the start, is to remember: whether it lay in the region, and the scheduling input that moves count from. */
static inline void kernel_remember(const Tables *t, double *state, int left, double scheduling) {
    KernelView v = kernel_view(t, state);
    v.in_range[0] = left == REGION_KEPT ? 1.0 : 0.0;
    v.scheduling_given[0] = scheduling;
}

/* limited = inputs, each held between its limits; the scheduling input moves no further than `most` from the last tick's:
   trained_move, or any number too large to matter at the start */
static inline void kernel_limited(
    const Tables *t, const double *state, double most, const double *inputs, double *limited) {
    double before = kernel_view(t, (double *)state).scheduling_given[0], move;
    int j;
    for (j = 0; j < FIXED(t, inputs); ++j) limited[j] = kernel_clip(inputs[j], t->input_minimum[j], t->input_maximum[j]);
    move = limited[FIXED(t, scheduling)] - before;
    if (move > most) limited[FIXED(t, scheduling)] = before + most;
    if (move < -most) limited[FIXED(t, scheduling)] = before - most;
}

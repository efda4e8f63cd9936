/* Unilateral contact of a network: the inputs that act while the pan-head may leave the wire.

   The scheduling input u_s is the height of the wire, an output y that of the pan-head. Off the wire, u_s > y, the wire has
   no effect: min(u_s, y) acts in its place, on everything alike: force, schedule, rebase, the column of B. What acts is held
   over a tick, so for a tick y is taken in its middle, y_n + T_s/2 y_dot_n. A wire held at y_n would be dragged along by the
   pan-head that flies, a damper of k_E T_s/2 that nobody built. */

typedef struct {
    int output;       /* y, the position of the pan-head; without feedthrough; negative = there is no such contact */
    int rate;         /* y_dot; without feedthrough */
    double half_tick; /* T_s / 2, s */
} Contact;

/* Whether the pan-head is off the wire now. */
static inline int kernel_is_off(const Tables *t, const Contact *contact, const double *state, const double *inputs) {
    const KernelView v = kernel_view(t, (double *)state);
    return inputs[FIXED(t, scheduling)] > v.held[contact->output];
}

/* acting = inputs, with min(u_s, y + ahead y_dot) in the place of u_s; for outputs ahead is 0, for a tick T_s/2. */
static inline void kernel_acting(
    const Tables *t, const Contact *contact, const double *state, double ahead, const double *inputs, double *acting) {
    const KernelView v = kernel_view(t, (double *)state);
    const double position = v.held[contact->output] + ahead * v.held[contact->rate];
    int j;
    for (j = 0; j < FIXED(t, inputs); ++j) acting[j] = inputs[j];
    if (acting[FIXED(t, scheduling)] > position) acting[FIXED(t, scheduling)] = position;
}

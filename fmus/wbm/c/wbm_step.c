/* One tick of co-simulation: classical Runge-Kutta of fourth order with constant inputs. */

enum { MOST_CROSSINGS = 8, CROSSING_STEPS = 16 };

/* One classical Runge-Kutta step of fourth order with constant inputs. */
static void wbm_runge_kutta(const Constants *k, const double *u, double h, const double *x, double *next) {
    double k1[STATE_COUNT], k2[STATE_COUNT], k3[STATE_COUNT], k4[STATE_COUNT], stage[STATE_COUNT];
    int n;
    wbm_derivatives(k, x, u, k1);
    for (n = 0; n < STATE_COUNT; ++n) stage[n] = x[n] + 0.5 * h * k1[n];
    wbm_derivatives(k, stage, u, k2);
    for (n = 0; n < STATE_COUNT; ++n) stage[n] = x[n] + 0.5 * h * k2[n];
    wbm_derivatives(k, stage, u, k3);
    for (n = 0; n < STATE_COUNT; ++n) stage[n] = x[n] + h * k3[n];
    wbm_derivatives(k, stage, u, k4);
    for (n = 0; n < STATE_COUNT; ++n) {
        next[n] = x[n] + h * (1.0 / 6.0) * ((k1[n] + k4[n]) + 2.0 * (k2[n] + k3[n]));
    }
}

/* Part of a step after which the pan-head has just changed sides: start on one side of the wire, x_end after the whole
   step h on the other; both with the equations k of the first side. Regula falsi, the standing end's gap halved; x_end
   becomes the state there. */
static double wbm_crossing(const Constants *k, const double *u, double h, const double *start, double *x_end) {
    const double close = 1.0e-13; /* m, of the order of rounding in xi */
    double before = 0.0, after = h, gap_before = start[STATE_XI] - u[INPUT_ETA];
    double gap_after = x_end[STATE_XI] - u[INPUT_ETA], weight_before = gap_before, weight_after = gap_after;
    int n, i;
    for (n = 0; n < CROSSING_STEPS && wbm_absolute(gap_after) > close; ++n) {
        double trial[STATE_COUNT];
        const double middle = before + (after - before) * (weight_before / (weight_before - weight_after));
        wbm_runge_kutta(k, u, middle, start, trial);
        if ((trial[STATE_XI] < u[INPUT_ETA]) == (gap_before < 0.0)) {
            before = middle;
            weight_before = trial[STATE_XI] - u[INPUT_ETA];
            weight_after *= 0.5;
        } else {
            after = middle;
            gap_after = weight_after = trial[STATE_XI] - u[INPUT_ETA];
            weight_before *= 0.5;
            for (i = 0; i < STATE_COUNT; ++i) x_end[i] = trial[i];
        }
    }
    return after;
}

/* A step of a unilateral contact: where the pan-head leaves the wire or touches it, the step is cut in two, so that every
   part has smooth equations and the order stays four. A touch that begins and ends inside one step is not seen. */
static void wbm_runge_kutta_cut(const Constants *k, const double *u, double h, const double *x, double *next) {
    Constants sides[2]; /* on the wire, off it */
    double start[STATE_COUNT];
    int n, piece, off = wbm_is_off(k, x, u);
    sides[0] = *k;
    sides[0].unilateral = 0.0;
    sides[1] = sides[0];
    sides[1].k_E = 0.0;
    for (n = 0; n < STATE_COUNT; ++n) start[n] = x[n];
    for (piece = 0; piece < MOST_CROSSINGS; ++piece) {
        wbm_runge_kutta(&sides[off], u, h, start, next);
        if (wbm_is_off(k, next, u) == off) return;
        h -= wbm_crossing(&sides[off], u, h, start, next);
        for (n = 0; n < STATE_COUNT; ++n) start[n] = next[n];
        off = !off;
    }
    wbm_runge_kutta(k, u, h, start, next); /* it grazes the wire: whatever is left goes in one step, kink and all */
}

/* Refuses states outside the regular branch of the linkage, and numbers that are none. */
static int wbm_check_state(const Model *model, const double *x, const double *u, Message *message) {
    int n, regular = x[STATE_PHI_1] > model->reach.phi_low && x[STATE_PHI_1] < model->reach.phi_high;
    for (n = 0; n < STATE_COUNT; ++n) regular = regular && wbm_absolute(x[n]) < 1.0e6;
    if (regular) return 0;
    message_append(message, "the motion leaves the linkage's regular range: the pan-head stood at xi = ");
    message_append_number(message, model->state[STATE_XI]);
    message_append(message, " m for the contact position eta = ");
    message_append_number(message, u[INPUT_ETA]);
    message_append(message, " m");
    wbm_append_reach(model, message);
    return 1;
}

/* One tick; the state is untouched when the motion leaves the regular branch of the linkage. */
static int wbm_advance(Model *model, const double *u, Message *message) {
    double next[STATE_COUNT];
    int n;
    if (wbm_check_inputs(model, u, message) || wbm_check_step(model, message)) return 1;
    if (model->constants.unilateral != 0.0) {
        wbm_runge_kutta_cut(&model->constants, u, model->step, model->state, next);
    } else {
        wbm_runge_kutta(&model->constants, u, model->step, model->state, next);
    }
    if (wbm_check_state(model, next, u, message)) return 1;
    for (n = 0; n < STATE_COUNT; ++n) model->state[n] = next[n];
    return 0;
}

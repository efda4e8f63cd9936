/* What is done with the equations before anything moves: the linkage's reach, the longest step, the static equilibrium. */

enum { REACH_SCAN = 640, REACH_HALVINGS = 60, BRACKET_HALVINGS = 40, KNEE_STEPS = 6, NEWTON_LIMIT = 20,
       FRICTION_SCAN = 64 };

/* The regular branch of the linkage with an unbent knee: the crossbar rises with the lower arm (z1 > 0). */
typedef struct {
    double phi_low, phi_high;       /* rad */
    double height_low, height_high; /* m */
} Reach;

typedef struct {
    Constants constants;
    Reach reach;
    double step;         /* s, inner step = tick */
    double longest_step; /* s, that friction allows */
    double state[STATE_COUNT];
} Model;

static double wbm_absolute(double x) { return x < 0.0 ? -x : x; }

static int wbm_is_regular(const Constants *k, double phi_1) {
    return wbm_geometry(k, phi_1, 0.0).zeta_phi > 0.0; /* false for NaN as well */
}

/* Edge of the regular branch between a regular and an irregular angle; the regular side of it. */
static COLD double wbm_edge(const Constants *k, double regular, double irregular) {
    int n;
    for (n = 0; n < REACH_HALVINGS; ++n) {
        double middle = 0.5 * (regular + irregular);
        if (wbm_is_regular(k, middle)) regular = middle;
        else irregular = middle;
    }
    return regular;
}

/* The branch that holds the angle at which lever and rod are nearest to square, e^2 = b^2 + c^2 with e growing. */
static COLD int wbm_find_reach(const Constants *k, Reach *reach) {
    const double c_square = 1.0 / (k->inverse_c * k->inverse_c), spacing = 0.01;
    double best = 1.0e300, centre = 0.0, phi_1;
    int n;
    for (n = -REACH_SCAN / 2; n < REACH_SCAN / 2; ++n) {
        double sine, cosine, ex, ey, misfit;
        phi_1 = spacing * (double)n;
        elementary_sine_cosine(phi_1, &sine, &cosine);
        ex = k->l1 * cosine - k->dx;
        ey = k->l1 * sine - k->dy;
        misfit = wbm_absolute(ex * ex + ey * ey - k->b * k->b - c_square);
        if (misfit < best && k->dx * sine - k->dy * cosine > 0.0 && wbm_is_regular(k, phi_1)) {
            best = misfit;
            centre = phi_1;
        }
    }
    if (!wbm_is_regular(k, centre)) return 1;
    for (phi_1 = centre, n = 0; n < REACH_SCAN && wbm_is_regular(k, phi_1); ++n) phi_1 -= spacing;
    reach->phi_low = wbm_edge(k, phi_1 + spacing, phi_1);
    for (phi_1 = centre, n = 0; n < REACH_SCAN && wbm_is_regular(k, phi_1); ++n) phi_1 += spacing;
    reach->phi_high = wbm_edge(k, phi_1 - spacing, phi_1);
    reach->height_low = wbm_geometry(k, reach->phi_low, 0.0).zeta;
    reach->height_high = wbm_geometry(k, reach->phi_high, 0.0).zeta;
    return 0;
}

static COLD void wbm_append_reach(const Model *model, Message *message) {
    message_append(message, "; unbent, the linkage reaches heights from ");
    message_append_number(message, model->reach.height_low);
    message_append(message, " m to ");
    message_append_number(message, model->reach.height_high);
    message_append(message, " m");
}

/* Refuses inputs the linkage cannot follow, and numbers that are none. */
static int wbm_check_inputs(const Model *model, const double *u, Message *message) {
    if (!(u[INPUT_ETA] >= model->reach.height_low && u[INPUT_ETA] <= model->reach.height_high)) {
        message_append(message, "the contact position eta = ");
        message_append_number(message, u[INPUT_ETA]);
        message_append(message, " m is out of reach");
        wbm_append_reach(model, message);
        return 1;
    }
    if (!(wbm_absolute(u[INPUT_TORQUE]) <= 1.0e9)) {
        message_append(message, "the torque M_pa = ");
        message_append_number(message, u[INPUT_TORQUE]);
        message_append(message, " N.m is not a number the model can use; set a finite torque");
        return 1;
    }
    return 0;
}

/* The longest stable inner step under friction: Runge-Kutta of fourth order decays up to a product of step and decay rate of
   2.785. Over the middle three quarters of the lower arm's range; at the dead centres the joints turn without bound. */
static COLD double wbm_longest_step(const Constants *k, const Reach *reach) {
    const double rest[STATE_COUNT] = {0.0}, range = reach->phi_high - reach->phi_low;
    double fastest = 0.0;
    int n;
    for (n = 0; k->friction.acts != 0.0 && n <= FRICTION_SCAN; ++n) {
        const double share = 0.125 + 0.75 * (double)n / (double)FRICTION_SCAN;
        const Geometry s = wbm_geometry(k, reach->phi_low + range * share, 0.0);
        const Dynamics m = wbm_dynamics(k, &s, rest);
        const double decay = friction_fastest_decay(&k->friction, s.theta_1, s.rho_1, m.m11, m.m12, m.m22);
        if (decay > fastest) fastest = decay;
    }
    return fastest > 0.0 ? 2.5 / fastest : 1.0e300;
}

/* Asked of every tick only: an importer that integrates by itself chooses its own steps. */
static COLD int wbm_check_step(const Model *model, Message *message) {
    if (model->step <= 1.00001 * model->longest_step) return 0; /* the message rounds it */
    message_append(message, "inner_step = ");
    message_append_number(message, model->step);
    message_append(message, " s is too long for this friction and its friction_slip_rate: at most ");
    message_append_number(message, model->longest_step);
    message_append(message, " s is stable; choose a shorter inner_step or a larger friction_slip_rate");
    return 1;
}

static COLD int wbm_prepare(Model *model, const Parameters *parameters, double step, Message *message) {
    int n;
    if (!(step > 0.0 && step <= 0.01)) {
        message_append(message, "inner_step = ");
        message_append_number(message, step);
        message_append(message, " s is outside (0, 0.01]; 0.0005 is the default");
        return 1;
    }
    model->constants = wbm_constants(parameters);
    model->step = step;
    for (n = 0; n < STATE_COUNT; ++n) model->state[n] = 0.0;
    if (wbm_find_reach(&model->constants, &model->reach)) {
        message_append(message, "these link lengths do not close to a linkage; check l1, b, c, dx and dy");
        return 1;
    }
    model->longest_step = wbm_longest_step(&model->constants, &model->reach);
    return 0;
}

/* Angle of the lower arm at which the crossbar stands at a height, knee unbent: zeta is monotone on the branch. */
static COLD double wbm_angle_at(const Model *model, double height) {
    double low = model->reach.phi_low, high = model->reach.phi_high;
    int n;
    for (n = 0; n < REACH_HALVINGS; ++n) {
        double middle = 0.5 * (low + high);
        if (wbm_geometry(&model->constants, middle, 0.0).zeta < height) low = middle;
        else high = middle;
    }
    return 0.5 * (low + high);
}

/* The states that stand at rest, and the change of their accelerations with them: j[row][column]. */
static const int wbm_coordinate[3] = {STATE_PHI_1, STATE_DELTA, STATE_XI};

static COLD void wbm_stiffness(const Constants *k, const double *x, const double *u, double j[3][3]) {
    const double no_input[INPUTS] = {0.0, 0.0};
    int row, column;
    for (column = 0; column < 3; ++column) {
        double direction[STATE_COUNT] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, d_rate[STATE_COUNT];
        direction[wbm_coordinate[column]] = 1.0;
        wbm_derivatives_tangent(k, x, u, direction, no_input, d_rate);
        for (row = 0; row < 3; ++row) j[row][column] = d_rate[wbm_coordinate[row] + 1];
    }
}

/* x = j^-1 r by Cramer's rule; returns the determinant. */
static COLD double wbm_cramer(double j[3][3], const double r[3], double x[3]) {
    const double determinant = j[0][0] * (j[1][1] * j[2][2] - j[1][2] * j[2][1])
                             - j[0][1] * (j[1][0] * j[2][2] - j[1][2] * j[2][0])
                             + j[0][2] * (j[1][0] * j[2][1] - j[1][1] * j[2][0]);
    x[0] = (r[0] * (j[1][1] * j[2][2] - j[1][2] * j[2][1]) - j[0][1] * (r[1] * j[2][2] - j[1][2] * r[2])
            + j[0][2] * (r[1] * j[2][1] - j[1][1] * r[2])) / determinant;
    x[1] = (j[0][0] * (r[1] * j[2][2] - j[1][2] * r[2]) - r[0] * (j[1][0] * j[2][2] - j[1][2] * j[2][0])
            + j[0][2] * (j[1][0] * r[2] - r[1] * j[2][0])) / determinant;
    x[2] = (j[0][0] * (j[1][1] * r[2] - r[1] * j[2][1]) - j[0][1] * (j[1][0] * r[2] - r[1] * j[2][0])
            + r[0] * (j[1][0] * j[2][1] - j[1][1] * j[2][0])) / determinant;
    return determinant;
}

/* Newton step of (phi1, delta, xi) towards zero acceleration; returns the determinant, which is negative where the
   equilibrium is stable (it is -det K / det M). */
static COLD double wbm_newton_step(const Constants *k, const double *x, const double *u, double *change) {
    double j[3][3], rate[STATE_COUNT], r[3];
    int row;
    wbm_derivatives(k, x, u, rate);
    wbm_stiffness(k, x, u, j);
    for (row = 0; row < 3; ++row) r[row] = -rate[wbm_coordinate[row] + 1];
    return wbm_cramer(j, r, change);
}

/* Change dx of the static equilibrium x that takes a change d_rate of the accelerations back: they stay zero. */
static COLD void wbm_equilibrium_tangent(
    const Constants *k, const double *x, const double *u, const double *d_rate, double *dx
) {
    double j[3][3], r[3], change[3];
    int n;
    for (n = 0; n < STATE_COUNT; ++n) dx[n] = 0.0;
    wbm_stiffness(k, x, u, j);
    for (n = 0; n < 3; ++n) r[n] = -d_rate[wbm_coordinate[n] + 1];
    (void)wbm_cramer(j, r, change);
    for (n = 0; n < 3; ++n) dx[wbm_coordinate[n]] = change[n];
}

/* Residual V1 - M + F_H z1 of the lower arm at rest, with the pan-head and the knee in balance:
   F_H = k_C (k_E (zeta - eta) + mC g) / (k_C + k_E), and delta (in and out) from V2 + k_d delta + F_H z2 = 0. */
static COLD double wbm_arm_residual(const Constants *k, const double *u, double phi_1, double *delta) {
    const double share = k->k_C / (k->k_C + k->k_E), head_weight = k->g / k->inverse_head_mass;
    Geometry s = wbm_geometry(k, phi_1, *delta);
    double force = 0.0;
    int n;
    for (n = 0; n < KNEE_STEPS; ++n) {
        double residual, slope;
        force = share * (k->k_E * (s.zeta - u[INPUT_ETA]) + head_weight);
        residual = k->upper_gravity * s.cos_psi + k->k_d * *delta + force * s.zeta_delta;
        slope = k->k_d + share * k->k_E * s.zeta_delta * s.zeta_delta
              - (k->upper_gravity + force * k->l2) * s.sin_psi;
        *delta -= residual / slope;
        s = wbm_geometry(k, phi_1, *delta);
    }
    force = share * (k->k_E * (s.zeta - u[INPUT_ETA]) + head_weight);
    return k->lower_gravity * s.cos_phi + k->upper_gravity * s.cos_psi * s.theta_1
         + k->rod_gravity * s.cos_rho * s.rho_1 - u[INPUT_TORQUE] + force * s.zeta_phi;
}

/* Angle and bend near the equilibrium: the residual grows with the angle where it is stable, so its change of sign
   nearest to the unbent linkage at the wire is bracketed by walking, then halved. 1 when there is none. */
static COLD int wbm_bracket_equilibrium(const Model *model, const double *u, double *phi_1, double *delta) {
    const double walk = 0.002;
    const Reach *reach = &model->reach;
    double low = wbm_angle_at(model, u[INPUT_ETA]), high = low;
    int n;
    *delta = 0.0;
    if (wbm_arm_residual(&model->constants, u, low, delta) < 0.0) {
        do {
            low = high;
            high = low + walk;
            if (!(high < reach->phi_high)) return 1;
        } while (!(wbm_arm_residual(&model->constants, u, high, delta) >= 0.0));
    } else {
        do {
            high = low;
            low = high - walk;
            if (!(low > reach->phi_low)) low = reach->phi_low;
            if (!(high > reach->phi_low)) return 1;
        } while (!(wbm_arm_residual(&model->constants, u, low, delta) < 0.0));
    }
    for (n = 0; n < BRACKET_HALVINGS; ++n) {
        *phi_1 = 0.5 * (low + high);
        if (wbm_arm_residual(&model->constants, u, *phi_1, delta) < 0.0) low = *phi_1;
        else high = *phi_1;
    }
    return !(wbm_absolute(*delta) < 1.0);
}

/* Static equilibrium for the inputs: a bracket, then Newton with the exact tangent to the last digits. */
static COLD int wbm_solve_equilibrium(const Model *model, const double *u, double *x) {
    double change[3], determinant, size;
    Constants pulling = model->constants; /* a unilateral contact at rest is a bilateral one that happens to press */
    const Constants *k = &pulling;
    int n;
    pulling.unilateral = 0.0;
    for (n = 0; n < STATE_COUNT; ++n) x[n] = 0.0;
    if (wbm_bracket_equilibrium(model, u, &x[STATE_PHI_1], &x[STATE_DELTA])) return 1;
    x[STATE_XI] = (k->k_C * wbm_geometry(k, x[STATE_PHI_1], x[STATE_DELTA]).zeta + k->k_E * u[INPUT_ETA]
                   - k->g / k->inverse_head_mass) / (k->k_C + k->k_E);
    for (n = 0; n < NEWTON_LIMIT; ++n) {
        determinant = wbm_newton_step(k, x, u, change);
        size = wbm_absolute(change[0]) + wbm_absolute(change[1]) + wbm_absolute(change[2]);
        if (!(size < 0.1)) return 1;
        x[STATE_PHI_1] += change[0];
        x[STATE_DELTA] += change[1];
        x[STATE_XI] += change[2];
        if (size < 1.0e-12) {
            return !(determinant < 0.0 && x[STATE_PHI_1] > model->reach.phi_low
                     && x[STATE_PHI_1] < model->reach.phi_high);
        }
    }
    return 1;
}

/* Puts the model into the static equilibrium of the inputs; the state is untouched when there is none. */
static COLD int wbm_start(Model *model, const double *u, Message *message) {
    double x[STATE_COUNT];
    int n;
    if (wbm_check_inputs(model, u, message)) return 1;
    if (wbm_solve_equilibrium(model, u, x)) {
        message_append(message, "there is no static equilibrium at the contact position eta = ");
        message_append_number(message, u[INPUT_ETA]);
        message_append(message, " m with the torque M_pa = ");
        message_append_number(message, u[INPUT_TORQUE]);
        message_append(message, " N.m");
        wbm_append_reach(model, message);
        return 1;
    }
    if (wbm_is_off(&model->constants, x, u)) {
        message_append(message, "the torque M_pa = ");
        message_append_number(message, u[INPUT_TORQUE]);
        message_append(message, " N.m does not hold the pan-head on a wire at the contact position eta = ");
        message_append_number(message, u[INPUT_ETA]);
        message_append(message, " m: at rest the wire would have to pull with ");
        message_append_number(message, model->constants.k_E * (u[INPUT_ETA] - x[STATE_XI]));
        message_append(message, " N, which a unilateral contact cannot; start with a larger torque");
        return 1;
    }
    for (n = 0; n < STATE_COUNT; ++n) model->state[n] = x[n];
    return 0;
}

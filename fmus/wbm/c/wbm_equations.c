/* Equations of motion of the white-box pantograph model in closed form; no acos, no atan2.

   Plane, x horizontal, y up, origin in the pivot A of the lower arm; u(a) = (cos a, sin a), n(a) = (-sin a, cos a).
   Lower arm A-B (l1, angle phi1), knee lever B-C (b, angle theta), thrust rod D-C (c, angle rho, D fixed on the
   frame), long arm B-P (l2, angle psi), elastic hinge delta at the knee between lever and long arm, crossbar P,
   pan-head xi. A prime is d/dphi1. The README beside this folder derives what stands here. */

/* Parameters of the model, SI units and radians; parameters.json gives value, meaning and origin of each. */
typedef struct {
    double l1, l2, b, c, dx, dy, alpha, yA;
    double m1, s1, J1, m2, s2, J2, m3, mB, mK, mC;
    double k_C, c_C, k_d, c_d, k_E, g;
    double crossbar_drift_reference;
    double unilateral; /* 0 or 1 */
    double friction_base, friction_knee, friction_rod_end, friction_rod_foot, friction_bend;
    double friction_slip_rate, friction_stribeck_ratio, friction_stribeck_rate;
} Parameters;

/* What the equations need of the parameters, computed once. */
typedef struct {
    double l1, l2, b, dx, dy, alpha, yA, drift_reference;
    double k_C, c_C, k_d, c_d, k_E, g;
    double half_over_b;       /* 1 / (2 b) */
    double closure;           /* b^2 - c^2 */
    double inverse_c;         /* 1 / c */
    double inverse_head_mass; /* 1 / mC */
    double lower_inertia;     /* I1 + mm l1^2, I1 = J1 + m1 s1^2, mm = m2 + mK + mB */
    double rod_inertia;       /* I3 = m3 c^2 / 3 */
    double coupling;          /* S2 l1, S2 = m2 s2 + mK l2 */
    double upper_inertia;     /* J2B = J2 + m2 s2^2 + mK l2^2 */
    double lower_gravity;     /* g (m1 s1 + mm l1) */
    double upper_gravity;     /* g S2 */
    double rod_gravity;       /* g m3 c / 2 */
    double unilateral;        /* 1 where the pan-head may leave the wire, else 0 */
    Friction friction;
} Constants;

/* Order of the states: thesis eq. (2.1). */
enum { STATE_PHI_1, STATE_PHI_1_DOT, STATE_DELTA, STATE_DELTA_DOT, STATE_XI, STATE_XI_DOT, STATE_COUNT };
enum { INPUT_ETA, INPUT_TORQUE, INPUTS };
enum {
    OUTPUT_XI, OUTPUT_XI_DOT, OUTPUT_ZETA, OUTPUT_ZETA_DOT, OUTPUT_F_H, OUTPUT_F_P,
    OUTPUT_PHI_1, OUTPUT_PHI_1_DOT, OUTPUT_DELTA, OUTPUT_DELTA_DOT, OUTPUT_CROSSBAR_DRIFT, OUTPUT_COUNT
};

/* Everything that depends on phi1 and delta only. */
typedef struct {
    double cos_phi, sin_phi;                   /* u(phi1) */
    double cos_theta, sin_theta;               /* u(theta) */
    double cos_rho, sin_rho;                   /* u(rho) */
    double cos_psi, sin_psi;                   /* u(psi) */
    double cos_between, sin_between;           /* of Dl = psi - phi1 */
    double theta_1, theta_2, rho_1, rho_2;     /* theta', theta'', rho', rho'' */
    double arm_x, arm_y, lever;                /* R = C - D, b R.n(theta) */
    double zeta, zeta_phi, zeta_delta;         /* zeta, z1 = dzeta/dphi1, z2 = dzeta/ddelta */
} Geometry;

static Friction wbm_friction(const Parameters *p) {
    Friction f;
    int n;
    f.coulomb[JOINT_BASE] = p->friction_base;
    f.coulomb[JOINT_KNEE] = p->friction_knee;
    f.coulomb[JOINT_ROD_END] = p->friction_rod_end;
    f.coulomb[JOINT_ROD_FOOT] = p->friction_rod_foot;
    f.bend = p->friction_bend;
    f.excess = p->friction_stribeck_ratio - 1.0;
    f.inverse_slip = 1.0 / p->friction_slip_rate;
    f.inverse_stribeck = 1.0 / p->friction_stribeck_rate;
    f.acts = f.bend != 0.0 ? 1.0 : 0.0;
    for (n = 0; n < JOINTS; ++n) f.acts = f.coulomb[n] != 0.0 ? 1.0 : f.acts;
    return f;
}

static Constants wbm_constants(const Parameters *p) {
    Constants k;
    double carried = p->m2 + p->mK + p->mB;
    double static_moment = p->m2 * p->s2 + p->mK * p->l2;
    k.l1 = p->l1;
    k.l2 = p->l2;
    k.b = p->b;
    k.dx = p->dx;
    k.dy = p->dy;
    k.alpha = p->alpha;
    k.yA = p->yA;
    k.drift_reference = p->crossbar_drift_reference;
    k.k_C = p->k_C;
    k.c_C = p->c_C;
    k.k_d = p->k_d;
    k.c_d = p->c_d;
    k.k_E = p->k_E;
    k.g = p->g;
    k.half_over_b = 0.5 / p->b;
    k.closure = p->b * p->b - p->c * p->c;
    k.inverse_c = 1.0 / p->c;
    k.inverse_head_mass = 1.0 / p->mC;
    k.lower_inertia = p->J1 + p->m1 * p->s1 * p->s1 + carried * p->l1 * p->l1;
    k.rod_inertia = p->m3 * p->c * p->c / 3.0;
    k.coupling = static_moment * p->l1;
    k.upper_inertia = p->J2 + p->m2 * p->s2 * p->s2 + p->mK * p->l2 * p->l2;
    k.lower_gravity = p->g * (p->m1 * p->s1 + carried * p->l1);
    k.upper_gravity = p->g * static_moment;
    k.rod_gravity = 0.5 * p->g * p->m3 * p->c;
    k.unilateral = p->unilateral;
    k.friction = wbm_friction(p);
    return k;
}

/* Four-bar and crossbar for phi1, delta. Where the linkage does not close, the fields become NaN. */
static Geometry wbm_geometry(const Constants *k, double phi_1, double delta) {
    Geometry s;
    double ex, ey, inverse_square, along, across, cos_turn, sin_turn, vx, vy, ax, ay, inverse_lever;
    elementary_sine_cosine(phi_1, &s.sin_phi, &s.cos_phi);
    elementary_sine_cosine(delta - k->alpha, &sin_turn, &cos_turn);
    /* E = l1 u(phi1) - (dx, dy); u(theta) is -E/e turned by gamma, cos gamma = (e^2 + b^2 - c^2) / (2 e b):
       along = cos gamma / e, across = sin gamma / e */
    ex = k->l1 * s.cos_phi - k->dx;
    ey = k->l1 * s.sin_phi - k->dy;
    inverse_square = 1.0 / (ex * ex + ey * ey);
    along = k->half_over_b + k->half_over_b * k->closure * inverse_square;
    across = elementary_sqrt(inverse_square - along * along);
    s.cos_theta = ey * across - ex * along;
    s.sin_theta = -ey * along - ex * across;
    /* R = E + b u(theta); rho is its direction */
    s.arm_x = ex + k->b * s.cos_theta;
    s.arm_y = ey + k->b * s.sin_theta;
    s.cos_rho = s.arm_x * k->inverse_c;
    s.sin_rho = s.arm_y * k->inverse_c;
    /* theta' = -l1 R.n(phi1) / (b R.n(theta)) */
    s.lever = k->b * (s.arm_y * s.cos_theta - s.arm_x * s.sin_theta);
    inverse_lever = 1.0 / s.lever;
    s.theta_1 = -k->l1 * (s.arm_y * s.cos_phi - s.arm_x * s.sin_phi) * inverse_lever;
    /* v = R' = l1 n(phi1) + b theta' n(theta); l1 u(phi1) + b theta'^2 u(theta) = -(ax, ay) so far */
    vx = -k->l1 * s.sin_phi - k->b * s.theta_1 * s.sin_theta;
    vy = k->l1 * s.cos_phi + k->b * s.theta_1 * s.cos_theta;
    ax = -k->l1 * s.cos_phi - k->b * s.theta_1 * s.theta_1 * s.cos_theta;
    ay = -k->l1 * s.sin_phi - k->b * s.theta_1 * s.theta_1 * s.sin_theta;
    /* theta'' = [R.(l1 u(phi1) + b theta'^2 u(theta)) - v.v] / (b R.n(theta)) */
    s.theta_2 = -(s.arm_x * ax + s.arm_y * ay + vx * vx + vy * vy) * inverse_lever;
    /* rho' = v.n(rho)/c; rho'' = a.n(rho)/c, a = R'' = ... + b theta'' n(theta) */
    s.rho_1 = (vy * s.cos_rho - vx * s.sin_rho) * k->inverse_c;
    ax -= k->b * s.theta_2 * s.sin_theta;
    ay += k->b * s.theta_2 * s.cos_theta;
    s.rho_2 = (ay * s.cos_rho - ax * s.sin_rho) * k->inverse_c;
    /* psi = theta + pi - alpha + delta */
    s.cos_psi = s.sin_theta * sin_turn - s.cos_theta * cos_turn;
    s.sin_psi = -s.sin_theta * cos_turn - s.cos_theta * sin_turn;
    s.cos_between = s.cos_psi * s.cos_phi + s.sin_psi * s.sin_phi;
    s.sin_between = s.sin_psi * s.cos_phi - s.cos_psi * s.sin_phi;
    /* zeta = yA + l1 sin phi1 + l2 sin psi */
    s.zeta = k->yA + k->l1 * s.sin_phi + k->l2 * s.sin_psi;
    s.zeta_delta = k->l2 * s.cos_psi;
    s.zeta_phi = k->l1 * s.cos_phi + s.zeta_delta * s.theta_1;
    return s;
}

/* What M, h and F_H are made of. */
typedef struct {
    double turning;          /* psi_dot = theta' phi1_dot + delta_dot */
    double zeta_dot;         /* z1 phi1_dot + z2 delta_dot */
    double crossbar_force;   /* F_H = k_C (zeta - xi) + c_C (zeta_dot - xi_dot) */
    double cross, swing;     /* S2 l1 cos Dl, S2 l1 sin Dl */
    double m11, m12, m22;    /* M */
    double shape_1, shape_2; /* h1 = shape_1 phi1_dot^2 - swing psi_dot^2, h2 = shape_2 phi1_dot^2 */
} Dynamics;

static Dynamics wbm_dynamics(const Constants *k, const Geometry *s, const double *x) {
    Dynamics m;
    const double i2 = k->upper_inertia, i3 = k->rod_inertia;
    m.turning = s->theta_1 * x[STATE_PHI_1_DOT] + x[STATE_DELTA_DOT];
    m.zeta_dot = s->zeta_phi * x[STATE_PHI_1_DOT] + s->zeta_delta * x[STATE_DELTA_DOT];
    m.crossbar_force = k->k_C * (s->zeta - x[STATE_XI]) + k->c_C * (m.zeta_dot - x[STATE_XI_DOT]);
    m.cross = k->coupling * s->cos_between;
    m.swing = k->coupling * s->sin_between;
    /* M11 = I1 + mm l1^2 + I3 rho'^2 + 2 S2 l1 cos Dl theta' + J2B theta'^2, M12 = S2 l1 cos Dl + J2B theta' */
    m.m11 = k->lower_inertia + i3 * s->rho_1 * s->rho_1 + (2.0 * m.cross + i2 * s->theta_1) * s->theta_1;
    m.m12 = m.cross + i2 * s->theta_1;
    m.m22 = i2;
    /* h1 = I3 rho' rho'' w^2 + S2 l1 [cos Dl theta'' w^2 - sin Dl psi_dot^2 + theta' sin Dl w^2]
            + J2B theta' theta'' w^2,  h2 = S2 l1 sin Dl w^2 + J2B theta'' w^2,  w = phi1_dot */
    m.shape_2 = m.swing + i2 * s->theta_2;
    m.shape_1 = i3 * s->rho_1 * s->rho_2 + m.cross * s->theta_2 + m.shape_2 * s->theta_1;
    return m;
}

/* phi1'' and delta'' from M(q) qdd = (q1, q2). */
static void wbm_solve(const Dynamics *m, double q1, double q2, double *rate) {
    const double inverse = 1.0 / (m->m11 * m->m22 - m->m12 * m->m12);
    rate[STATE_PHI_1_DOT] = (q1 * m->m22 - q2 * m->m12) * inverse;
    rate[STATE_DELTA_DOT] = (q2 * m->m11 - q1 * m->m12) * inverse;
}

/* Whether the pan-head is off the wire, which only a unilateral contact allows. */
static int wbm_is_off(const Constants *k, const double *x, const double *u) {
    return k->unilateral != 0.0 && x[STATE_XI] < u[INPUT_ETA];
}

/* F_p = k_E (xi - eta_eff); eta_eff is eta, of a unilateral contact min(eta, xi). */
static double wbm_contact_force(const Constants *k, const double *x, const double *u) {
    const double eta_eff = wbm_is_off(k, x, u) ? x[STATE_XI] : u[INPUT_ETA];
    return k->k_E * (x[STATE_XI] - eta_eff);
}

/* Time derivatives of the six states: M(q) qdd + h = Q. */
static void wbm_derivatives(const Constants *k, const double *x, const double *u, double *rate) {
    const Geometry s = wbm_geometry(k, x[STATE_PHI_1], x[STATE_DELTA]);
    const Dynamics m = wbm_dynamics(k, &s, x);
    const double ww = x[STATE_PHI_1_DOT] * x[STATE_PHI_1_DOT];
    const double contact_force = wbm_contact_force(k, x, u);
    /* V1 = g (m1 s1 + mm l1) cos phi1 + g S2 cos psi theta' + g m3 c/2 cos rho rho', V2 = g S2 cos psi */
    const double v2 = k->upper_gravity * s.cos_psi;
    const double v1 = k->lower_gravity * s.cos_phi + v2 * s.theta_1 + k->rod_gravity * s.cos_rho * s.rho_1;
    double q1 = u[INPUT_TORQUE] - v1 - (m.shape_1 * ww - m.swing * m.turning * m.turning)
              - m.crossbar_force * s.zeta_phi;
    double q2 = -k->k_d * x[STATE_DELTA] - k->c_d * x[STATE_DELTA_DOT] - v2 - m.shape_2 * ww
              - m.crossbar_force * s.zeta_delta;
    if (k->friction.acts != 0.0) {
        q1 -= friction_on_arm(&k->friction, s.theta_1, s.rho_1, x[STATE_PHI_1_DOT]);
        q2 -= friction_torque(&k->friction, k->friction.bend, x[STATE_DELTA_DOT]);
    }
    wbm_solve(&m, q1, q2, rate);
    rate[STATE_PHI_1] = x[STATE_PHI_1_DOT];
    rate[STATE_DELTA] = x[STATE_DELTA_DOT];
    rate[STATE_XI] = x[STATE_XI_DOT];
    rate[STATE_XI_DOT] = (m.crossbar_force - contact_force) * k->inverse_head_mass - k->g;
}

/* The eleven outputs; x_P = l1 cos phi1 + l2 cos psi, less its reference, is the crossbar drift. */
static void wbm_outputs(const Constants *k, const double *x, const double *u, double *y) {
    const Geometry s = wbm_geometry(k, x[STATE_PHI_1], x[STATE_DELTA]);
    const Dynamics m = wbm_dynamics(k, &s, x);
    y[OUTPUT_XI] = x[STATE_XI];
    y[OUTPUT_XI_DOT] = x[STATE_XI_DOT];
    y[OUTPUT_ZETA] = s.zeta;
    y[OUTPUT_ZETA_DOT] = m.zeta_dot;
    y[OUTPUT_F_H] = m.crossbar_force;
    y[OUTPUT_F_P] = wbm_contact_force(k, x, u);
    y[OUTPUT_PHI_1] = x[STATE_PHI_1];
    y[OUTPUT_PHI_1_DOT] = x[STATE_PHI_1_DOT];
    y[OUTPUT_DELTA] = x[STATE_DELTA];
    y[OUTPUT_DELTA_DOT] = x[STATE_DELTA_DOT];
    y[OUTPUT_CROSSBAR_DRIFT] = k->l1 * s.cos_phi + s.zeta_delta - k->drift_reference;
}

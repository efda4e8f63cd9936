/* Tangent-linear model: the exact derivative of accelerations and outputs in one direction of states and inputs.

   Line by line the derivative of wbm_equations.c and wbm_friction.c; d_... is the change of ... along the direction. Where
   the pan-head just touches the wire, it is the derivative of the side of contact. */

/* Changes of the geometry with phi1 and delta. */
typedef struct {
    double d_phi, d_theta, d_psi, d_rho;
    double d_theta_1, d_theta_2, d_rho_1, d_rho_2;
    double d_zeta, d_zeta_phi, d_zeta_delta;
} GeometryTangent;

/* theta''' and rho''', from differentiating the closed forms of theta'' and rho'' once more. */
static void wbm_third_derivatives(const Constants *k, const Geometry *s, double *theta_3, double *rho_3) {
    const double b1 = k->b * s->theta_1, b2 = k->b * s->theta_2;
    const double b11 = b1 * s->theta_1, b12 = b1 * s->theta_2, b111 = b11 * s->theta_1;
    /* r = l1 u(phi1) + b theta'^2 u(theta), r' = l1 n(phi1) + 2 b theta' theta'' u(theta) + b theta'^3 n(theta) */
    const double rx = k->l1 * s->cos_phi + b11 * s->cos_theta;
    const double ry = k->l1 * s->sin_phi + b11 * s->sin_theta;
    const double sx = -k->l1 * s->sin_phi + 2.0 * b12 * s->cos_theta - b111 * s->sin_theta;
    const double sy = k->l1 * s->cos_phi + 2.0 * b12 * s->sin_theta + b111 * s->cos_theta;
    /* v = R' and a = R'' */
    const double vx = -k->l1 * s->sin_phi - b1 * s->sin_theta;
    const double vy = k->l1 * s->cos_phi + b1 * s->cos_theta;
    const double ax = -rx - b2 * s->sin_theta;
    const double ay = -ry + b2 * s->cos_theta;
    /* N = R.n(theta), N' = v.n(theta) - theta' R.u(theta) */
    const double lever_1 = k->b * (vy * s->cos_theta - vx * s->sin_theta)
                         - b1 * (s->arm_x * s->cos_theta + s->arm_y * s->sin_theta);
    /* b N theta''' = v.r + R.r' - 2 v.a - b N' theta'' */
    const double third = (vx * rx + vy * ry + s->arm_x * sx + s->arm_y * sy - 2.0 * (vx * ax + vy * ay)
                          - lever_1 * s->theta_2) / s->lever;
    /* a' = -r' + b theta''' n(theta) - b theta' theta'' u(theta) */
    const double jx = -sx - k->b * third * s->sin_theta - b12 * s->cos_theta;
    const double jy = -sy + k->b * third * s->cos_theta - b12 * s->sin_theta;
    *theta_3 = third;
    /* rho''' = (a'.n(rho) - rho' a.u(rho)) / c */
    *rho_3 = (jy * s->cos_rho - jx * s->sin_rho - s->rho_1 * (ax * s->cos_rho + ay * s->sin_rho)) * k->inverse_c;
}

static GeometryTangent wbm_geometry_tangent(const Constants *k, const Geometry *s, double d_phi, double d_delta) {
    GeometryTangent t;
    double theta_3, rho_3;
    wbm_third_derivatives(k, s, &theta_3, &rho_3);
    t.d_phi = d_phi;
    t.d_theta = s->theta_1 * d_phi;
    t.d_rho = s->rho_1 * d_phi;
    t.d_psi = t.d_theta + d_delta;
    t.d_theta_1 = s->theta_2 * d_phi;
    t.d_theta_2 = theta_3 * d_phi;
    t.d_rho_1 = s->rho_2 * d_phi;
    t.d_rho_2 = rho_3 * d_phi;
    t.d_zeta = s->zeta_phi * d_phi + s->zeta_delta * d_delta;
    t.d_zeta_delta = -k->l2 * s->sin_psi * t.d_psi;
    t.d_zeta_phi = -k->l1 * s->sin_phi * d_phi + t.d_zeta_delta * s->theta_1 + s->zeta_delta * t.d_theta_1;
    return t;
}

/* Changes of what M, h and F_H are made of. */
typedef struct {
    double d_turning, d_zeta_dot, d_crossbar_force, d_swing, d_m11, d_m12, d_shape_1, d_shape_2;
} DynamicsTangent;

static DynamicsTangent wbm_dynamics_tangent(
    const Constants *k, const Geometry *s, const GeometryTangent *t, const Dynamics *m, const double *x, const double *dx
) {
    DynamicsTangent n;
    const double i2 = k->upper_inertia, i3 = k->rod_inertia;
    const double d_between = t->d_psi - t->d_phi, d_cross = -m->swing * d_between;
    n.d_turning = t->d_theta_1 * x[STATE_PHI_1_DOT] + s->theta_1 * dx[STATE_PHI_1_DOT] + dx[STATE_DELTA_DOT];
    n.d_zeta_dot = t->d_zeta_phi * x[STATE_PHI_1_DOT] + s->zeta_phi * dx[STATE_PHI_1_DOT]
                 + t->d_zeta_delta * x[STATE_DELTA_DOT] + s->zeta_delta * dx[STATE_DELTA_DOT];
    n.d_crossbar_force = k->k_C * (t->d_zeta - dx[STATE_XI]) + k->c_C * (n.d_zeta_dot - dx[STATE_XI_DOT]);
    n.d_swing = m->cross * d_between;
    n.d_m11 = 2.0 * (i3 * s->rho_1 * t->d_rho_1 + d_cross * s->theta_1 + m->m12 * t->d_theta_1);
    n.d_m12 = d_cross + i2 * t->d_theta_1;
    n.d_shape_2 = n.d_swing + i2 * t->d_theta_2;
    n.d_shape_1 = i3 * (t->d_rho_1 * s->rho_2 + s->rho_1 * t->d_rho_2) + d_cross * s->theta_2
                + m->cross * t->d_theta_2 + n.d_shape_2 * s->theta_1 + m->shape_2 * t->d_theta_1;
    return n;
}

/* Change of F_p: off the wire eta_eff goes with xi. */
static double wbm_contact_force_tangent(
    const Constants *k, const double *x, const double *u, const double *dx, const double *du
) {
    const double d_eta_eff = wbm_is_off(k, x, u) ? dx[STATE_XI] : du[INPUT_ETA];
    return k->k_E * (dx[STATE_XI] - d_eta_eff);
}

/* Change of the state derivatives for a change dx of the states and du of the inputs. */
static void wbm_derivatives_tangent(
    const Constants *k, const double *x, const double *u, const double *dx, const double *du, double *d_rate
) {
    const Geometry s = wbm_geometry(k, x[STATE_PHI_1], x[STATE_DELTA]);
    const GeometryTangent t = wbm_geometry_tangent(k, &s, dx[STATE_PHI_1], dx[STATE_DELTA]);
    const Dynamics m = wbm_dynamics(k, &s, x);
    const DynamicsTangent n = wbm_dynamics_tangent(k, &s, &t, &m, x, dx);
    const double w = x[STATE_PHI_1_DOT], ww = w * w, d_ww = 2.0 * w * dx[STATE_PHI_1_DOT];
    const double d_contact = wbm_contact_force_tangent(k, x, u, dx, du);
    const double d_h1 = d_ww * m.shape_1 + ww * n.d_shape_1
                      - (n.d_swing * m.turning + 2.0 * m.swing * n.d_turning) * m.turning;
    const double d_h2 = d_ww * m.shape_2 + ww * n.d_shape_2;
    const double v2 = k->upper_gravity * s.cos_psi;
    const double d_v2 = -k->upper_gravity * s.sin_psi * t.d_psi;
    const double d_v1 = -k->lower_gravity * s.sin_phi * t.d_phi + d_v2 * s.theta_1 + v2 * t.d_theta_1
                      + k->rod_gravity * (s.cos_rho * t.d_rho_1 - s.sin_rho * t.d_rho * s.rho_1);
    double rate[STATE_COUNT], q1, q2;
    wbm_derivatives(k, x, u, rate);
    /* M d(qdd) = dQ - dM qdd */
    q1 = du[INPUT_TORQUE] - d_v1 - d_h1 - n.d_crossbar_force * s.zeta_phi - m.crossbar_force * t.d_zeta_phi
       - n.d_m11 * rate[STATE_PHI_1_DOT] - n.d_m12 * rate[STATE_DELTA_DOT];
    q2 = -k->k_d * dx[STATE_DELTA] - k->c_d * dx[STATE_DELTA_DOT] - d_v2 - d_h2
       - n.d_crossbar_force * s.zeta_delta - m.crossbar_force * t.d_zeta_delta - n.d_m12 * rate[STATE_PHI_1_DOT];
    if (k->friction.acts != 0.0) {
        const double slope = friction_slope(&k->friction, k->friction.bend, x[STATE_DELTA_DOT]);
        q1 -= friction_on_arm_tangent(&k->friction, s.theta_1, s.rho_1, w, t.d_theta_1, t.d_rho_1, dx[STATE_PHI_1_DOT]);
        q2 -= slope * dx[STATE_DELTA_DOT];
    }
    wbm_solve(&m, q1, q2, d_rate);
    d_rate[STATE_PHI_1] = dx[STATE_PHI_1_DOT];
    d_rate[STATE_DELTA] = dx[STATE_DELTA_DOT];
    d_rate[STATE_XI] = dx[STATE_XI_DOT];
    d_rate[STATE_XI_DOT] = (n.d_crossbar_force - d_contact) * k->inverse_head_mass;
}

/* Change of the outputs for a change dx of the states and du of the inputs. */
static void wbm_outputs_tangent(
    const Constants *k, const double *x, const double *u, const double *dx, const double *du, double *dy
) {
    const Geometry s = wbm_geometry(k, x[STATE_PHI_1], x[STATE_DELTA]);
    const GeometryTangent t = wbm_geometry_tangent(k, &s, dx[STATE_PHI_1], dx[STATE_DELTA]);
    const Dynamics m = wbm_dynamics(k, &s, x);
    const DynamicsTangent n = wbm_dynamics_tangent(k, &s, &t, &m, x, dx);
    dy[OUTPUT_XI] = dx[STATE_XI];
    dy[OUTPUT_XI_DOT] = dx[STATE_XI_DOT];
    dy[OUTPUT_ZETA] = t.d_zeta;
    dy[OUTPUT_ZETA_DOT] = n.d_zeta_dot;
    dy[OUTPUT_F_H] = n.d_crossbar_force;
    dy[OUTPUT_F_P] = wbm_contact_force_tangent(k, x, u, dx, du);
    dy[OUTPUT_PHI_1] = dx[STATE_PHI_1];
    dy[OUTPUT_PHI_1_DOT] = dx[STATE_PHI_1_DOT];
    dy[OUTPUT_DELTA] = dx[STATE_DELTA];
    dy[OUTPUT_DELTA_DOT] = dx[STATE_DELTA_DOT];
    dy[OUTPUT_CROSSBAR_DRIFT] = -k->l1 * s.sin_phi * t.d_phi - k->l2 * s.sin_psi * t.d_psi;
}

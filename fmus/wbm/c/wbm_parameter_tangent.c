/* How the static equilibrium follows the parameters: what their change does to geometry and forces at the same phi1, delta
   and xi, which is exact; the angles then follow as they follow the inputs. d_... is the change of ...; at rest only. */

/* Changes of the geometry with the parameters, phi1 and delta as they are. */
typedef struct {
    double d_psi, d_rho, d_theta_1, d_rho_1;
    double d_zeta, d_zeta_phi, d_zeta_delta;
} ShapeTangent;

static COLD ShapeTangent wbm_shape_tangent(const Parameters *p, const Parameters *d, const Geometry *s) {
    ShapeTangent t;
    const double rx = s->arm_x, ry = s->arm_y;
    const double vx = -p->l1 * s->sin_phi - p->b * s->theta_1 * s->sin_theta;
    const double vy = p->l1 * s->cos_phi + p->b * s->theta_1 * s->cos_theta;
    double d_theta, d_rx, d_ry, d_lever, d_turn, d_vx, d_vy;
    /* R = l1 u(phi1) - (dx, dy) + b u(theta) = c u(rho): R.dR = c dc gives dtheta, n(rho).dR = c drho */
    d_rx = d->l1 * s->cos_phi - d->dx + d->b * s->cos_theta;
    d_ry = d->l1 * s->sin_phi - d->dy + d->b * s->sin_theta;
    d_theta = (p->c * d->c - rx * d_rx - ry * d_ry) / s->lever;
    d_rx -= p->b * s->sin_theta * d_theta;
    d_ry += p->b * s->cos_theta * d_theta;
    t.d_rho = (d_ry * s->cos_rho - d_rx * s->sin_rho) / p->c;
    /* lever theta' = -l1 R.n(phi1), lever = b R.n(theta) */
    d_lever = d->b * s->lever / p->b + p->b * (d_ry * s->cos_theta - d_rx * s->sin_theta)
            - p->b * (rx * s->cos_theta + ry * s->sin_theta) * d_theta;
    d_turn = d->l1 * (ry * s->cos_phi - rx * s->sin_phi) + p->l1 * (d_ry * s->cos_phi - d_rx * s->sin_phi);
    t.d_theta_1 = -(d_turn + s->theta_1 * d_lever) / s->lever;
    /* c rho' = v.n(rho), v = l1 n(phi1) + b theta' n(theta) */
    d_turn = d->b * s->theta_1 + p->b * t.d_theta_1;
    d_vx = -d->l1 * s->sin_phi - d_turn * s->sin_theta - p->b * s->theta_1 * s->cos_theta * d_theta;
    d_vy = d->l1 * s->cos_phi + d_turn * s->cos_theta - p->b * s->theta_1 * s->sin_theta * d_theta;
    t.d_rho_1 = (d_vy * s->cos_rho - d_vx * s->sin_rho - (vx * s->cos_rho + vy * s->sin_rho) * t.d_rho
                 - s->rho_1 * d->c) / p->c;
    t.d_psi = d_theta - d->alpha;
    t.d_zeta = d->yA + d->l1 * s->sin_phi + d->l2 * s->sin_psi + s->zeta_delta * t.d_psi;
    t.d_zeta_delta = d->l2 * s->cos_psi - p->l2 * s->sin_psi * t.d_psi;
    t.d_zeta_phi = d->l1 * s->cos_phi + t.d_zeta_delta * s->theta_1 + s->zeta_delta * t.d_theta_1;
    return t;
}

/* Change of the accelerations and outputs with the parameters, for a model at rest in x; added to d_rate and dy. */
static COLD void wbm_add_parameter_tangent(
    const Parameters *p, const Parameters *d, const double *x, const double *u, double *d_rate, double *dy
) {
    const Constants k = wbm_constants(p);
    const Geometry s = wbm_geometry(&k, x[STATE_PHI_1], x[STATE_DELTA]);
    const Dynamics m = wbm_dynamics(&k, &s, x);
    const ShapeTangent t = wbm_shape_tangent(p, d, &s);
    const double carried = p->m2 + p->mK + p->mB, d_carried = d->m2 + d->mK + d->mB;
    const double upper = p->m2 * p->s2 + p->mK * p->l2;
    const double d_upper = d->m2 * p->s2 + p->m2 * d->s2 + d->mK * p->l2 + p->mK * d->l2;
    const double d_lower_gravity = d->g * (p->m1 * p->s1 + carried * p->l1)
                                 + p->g * (d->m1 * p->s1 + p->m1 * d->s1 + d_carried * p->l1 + carried * d->l1);
    const double d_upper_gravity = d->g * upper + p->g * d_upper;
    const double d_rod_gravity = 0.5 * (d->g * p->m3 * p->c + p->g * (d->m3 * p->c + p->m3 * d->c));
    const double d_force = d->k_C * (s.zeta - x[STATE_XI]) + p->k_C * t.d_zeta;
    const double d_contact = d->k_E * (x[STATE_XI] - u[INPUT_ETA]);
    const double v2 = k.upper_gravity * s.cos_psi;
    const double d_v2 = d_upper_gravity * s.cos_psi - k.upper_gravity * s.sin_psi * t.d_psi;
    const double d_v1 = d_lower_gravity * s.cos_phi + d_v2 * s.theta_1 + v2 * t.d_theta_1
                      + d_rod_gravity * s.cos_rho * s.rho_1
                      + k.rod_gravity * (s.cos_rho * t.d_rho_1 - s.sin_rho * t.d_rho * s.rho_1);
    const double q1 = -d_v1 - d_force * s.zeta_phi - m.crossbar_force * t.d_zeta_phi;
    const double q2 = -d->k_d * x[STATE_DELTA] - d_v2 - d_force * s.zeta_delta - m.crossbar_force * t.d_zeta_delta;
    double rate[STATE_COUNT];
    wbm_solve(&m, q1, q2, rate); /* M does not matter: nothing accelerates */
    d_rate[STATE_PHI_1_DOT] += rate[STATE_PHI_1_DOT];
    d_rate[STATE_DELTA_DOT] += rate[STATE_DELTA_DOT];
    /* (F_H - F_p) / mC = g at rest */
    d_rate[STATE_XI_DOT] += (d_force - d_contact - p->g * d->mC) * k.inverse_head_mass - d->g;
    dy[OUTPUT_ZETA] += t.d_zeta;
    dy[OUTPUT_F_H] += d_force;
    dy[OUTPUT_F_P] += d_contact;
    dy[OUTPUT_CROSSBAR_DRIFT] += d->l1 * s.cos_phi + t.d_zeta_delta - d->crossbar_drift_reference;
}

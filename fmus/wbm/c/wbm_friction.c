/* Dry friction in the joints, after Coulomb and Stribeck, with a smooth passage through rest.

   A joint that turns with the rate r is braked by T(r) = T_c [1 + (T_s/T_c - 1) exp(-(r/w_s)^2)] tanh(r/v_s). T is odd
   and zero at rest: what stands still is not held, so the static equilibrium does not know of friction. */

/* Joints that turn with the lower arm: its pivot A, the knee B between lower arm and lever, the rod's end C at the
   lever, the rod's foot D on the frame. */
enum { JOINT_BASE, JOINT_KNEE, JOINT_ROD_END, JOINT_ROD_FOOT, JOINTS };

typedef struct {
    double acts;             /* 0 where there is none */
    double coulomb[JOINTS];  /* T_c, N.m */
    double bend;             /* T_c of the elastic hinge delta, N.m */
    double excess;           /* T_s/T_c - 1 */
    double inverse_slip;     /* 1 / v_s, s/rad */
    double inverse_stribeck; /* 1 / w_s, s/rad */
} Friction;

/* T(rate). */
static double friction_torque(const Friction *f, double coulomb, double rate) {
    const double ratio = rate * f->inverse_stribeck;
    const double level = 1.0 + f->excess * elementary_exp(-ratio * ratio);
    return coulomb * level * elementary_tanh(rate * f->inverse_slip);
}

/* dT/drate. */
static double friction_slope(const Friction *f, double coulomb, double rate) {
    const double ratio = rate * f->inverse_stribeck, slip = elementary_tanh(rate * f->inverse_slip);
    const double raised = f->excess * elementary_exp(-ratio * ratio);
    return coulomb * ((1.0 + raised) * (1.0 - slip * slip) * f->inverse_slip
                      - 2.0 * raised * ratio * f->inverse_stribeck * slip);
}

/* Rates of the joints for phi1_dot = 1; theta', rho' or their changes. */
static void friction_turns(double base, double theta_1, double rho_1, double *turns) {
    turns[JOINT_BASE] = base;
    turns[JOINT_KNEE] = theta_1 - base;
    turns[JOINT_ROD_END] = rho_1 - theta_1;
    turns[JOINT_ROD_FOOT] = rho_1;
}

/* What the joints take from Q1, by virtual work: the sum of a T(a w) over their turns a; w = phi1_dot. */
static double friction_on_arm(const Friction *f, double theta_1, double rho_1, double w) {
    double turns[JOINTS], sum = 0.0;
    int n;
    friction_turns(1.0, theta_1, rho_1, turns);
    for (n = 0; n < JOINTS; ++n) {
        if (f->coulomb[n] != 0.0) sum += turns[n] * friction_torque(f, f->coulomb[n], turns[n] * w);
    }
    return sum;
}

/* Its change with w, theta' and rho'. */
static double friction_on_arm_tangent(
    const Friction *f, double theta_1, double rho_1, double w, double d_theta_1, double d_rho_1, double d_w
) {
    double turns[JOINTS], d_turns[JOINTS], sum = 0.0;
    int n;
    friction_turns(1.0, theta_1, rho_1, turns);
    friction_turns(0.0, d_theta_1, d_rho_1, d_turns);
    for (n = 0; n < JOINTS; ++n) {
        if (f->coulomb[n] != 0.0) {
            sum += d_turns[n] * friction_torque(f, f->coulomb[n], turns[n] * w)
                 + turns[n] * friction_slope(f, f->coulomb[n], turns[n] * w) * (d_turns[n] * w + turns[n] * d_w);
        }
    }
    return sum;
}

/* The fastest decay, 1/s, that friction causes at rest, where it is steepest: the largest eigenvalue of M^-1 F with
   F = diag(sum of a^2 T_s/v_s, T_s/v_s of the hinge). */
static double friction_fastest_decay(
    const Friction *f, double theta_1, double rho_1, double m11, double m12, double m22
) {
    const double steepest = (1.0 + f->excess) * f->inverse_slip, inverse = 1.0 / (m11 * m22 - m12 * m12);
    double turns[JOINTS], arm = 0.0, hinge = steepest * f->bend, half_trace;
    int n;
    friction_turns(1.0, theta_1, rho_1, turns);
    for (n = 0; n < JOINTS; ++n) arm += turns[n] * turns[n] * steepest * f->coulomb[n];
    half_trace = 0.5 * (m22 * arm + m11 * hinge) * inverse;
    return half_trace + elementary_sqrt(half_trace * half_trace - arm * hinge * inverse);
}

/* From physical parameters to a node table: three masses between the contact wire and a wall, blended over the nodes and
   discretised. What identification of a surrogate writes into a parameter set, and what an FMU does when somebody changes
   a parameter; needs elementary.c and linear_solve.c.

   wire --k_E-- m_C --k_C,c_C-- m_H --k_L,c_L-- m_M --k_W,c_W-- wall; c_H from m_H to ground; torques b_H M_pa, b_M M_pa
     m_C xi''      = k_C (zeta - xi) + c_C (zeta' - xi') - k_E (xi - eta)                              (thesis eq. 3.18)
     m_H zeta''    = k_L (delta_M - zeta) + c_L (delta_M' - zeta') - k_C (zeta - xi) - c_C (zeta' - xi') - c_H zeta' + b_H M_pa
     m_M delta_M'' = -k_W delta_M - c_W delta_M' - k_L (delta_M - zeta) - c_L (delta_M' - zeta') + b_M M_pa
   States xi, xi', zeta, zeta', delta_M, delta_M'; inputs eta, M_pa.

   Node k: every parameter is sum_i w_ki theta_i, in logarithms where it cannot be negative, never outside its limits. Then
   zero-order hold (eq. 3.28), [A B; 0 I] = exp(Ts [A_c B_c; 0 0]), and g, what the states at rest move per metre of eta. */

enum { CHAIN_STATES = 6, CHAIN_INPUTS = 2, CHAIN_SIZE = 8, CHAIN_TERMS = 18, CHAIN_SQUARINGS = 40 };

/* The coefficients of the equations; CHAIN_R_M stands for b_M = 1 / r_M. */
enum {
    CHAIN_M_C, CHAIN_K_C, CHAIN_C_C, CHAIN_K_E, CHAIN_HEAD, /* the first four are the collector head */
    CHAIN_M_H = CHAIN_HEAD, CHAIN_M_M, CHAIN_K_L, CHAIN_C_L, CHAIN_K_W, CHAIN_C_W, CHAIN_B_M, CHAIN_B_H, CHAIN_C_H,
    CHAIN_R_M, CHAIN_COEFFICIENTS
};

/* What cannot be built, and chain_table's answer when all is well. */
enum { CHAIN_FINE = 0, CHAIN_NO_REST = 1, CHAIN_UNSTABLE = 2 };

/* What of a surrogate stays when its parameters change. */
typedef struct {
    int parameters;            /* P */
    int local_models;          /* M */
    int nodes;                 /* K */
    double sample_time;        /* Ts, s */
    const int *coefficients;   /* [P] CHAIN_... */
    const int *logarithmic;    /* [P] 1 = blended in logarithms */
    const double *least;       /* [P] limits; the least of a logarithmic one is positive */
    const double *largest;     /* [P] */
    const double *weights;     /* [K][M] */
} ChainTables;

/* Size of states and inputs, powers of two, in which the matrices are exponentiated. */
static const double chain_scale[CHAIN_SIZE] = {1.0, 128.0, 1.0, 128.0, 1.0, 128.0, 1.0, 1.0};

static inline double chain_clip(double value, double least, double largest) {
    return value < least ? least : value > largest ? largest : value;
}

/* Parameter p at a node with the weights of the local models, theta[M][P]. */
RARE double chain_blended(const ChainTables *t, const double *theta, const double *weights, int p) {
    double sum = 0.0;
    int i;
    for (i = 0; i < t->local_models; ++i) {
        double value = chain_clip(theta[i * t->parameters + p], t->least[p], t->largest[p]);
        sum += weights[i] * (t->logarithmic[p] ? elementary_log(value) : value);
    }
    return chain_clip(t->logarithmic[p] ? elementary_exp(sum) : sum, t->least[p], t->largest[p]);
}

/* Every coefficient at a node; head[4] as numbered above. What a structure does not have is zero. */
RARE void chain_coefficients(
    const ChainTables *t, const double *head, const double *theta, const double *weights, double *c) {
    int i;
    for (i = 0; i < CHAIN_COEFFICIENTS; ++i) c[i] = i < CHAIN_HEAD ? head[i] : 0.0;
    for (i = 0; i < t->parameters; ++i) c[t->coefficients[i]] = chain_blended(t, theta, weights, i);
    if (c[CHAIN_R_M] != 0.0) c[CHAIN_B_M] = 1.0 / c[CHAIN_R_M];
}

/* The rows of [A_c B_c] */
RARE void chain_continuous(const double *c, double matrix[CHAIN_STATES][CHAIN_SIZE]) {
    double m_C = c[CHAIN_M_C], m_H = c[CHAIN_M_H], m_M = c[CHAIN_M_M];
    int i, j;
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) matrix[i][j] = i % 2 == 0 && j == i + 1 ? 1.0 : 0.0;
    }
    matrix[1][0] = -(c[CHAIN_K_E] + c[CHAIN_K_C]) / m_C;
    matrix[1][1] = -c[CHAIN_C_C] / m_C;
    matrix[1][2] = c[CHAIN_K_C] / m_C;
    matrix[1][3] = c[CHAIN_C_C] / m_C;
    matrix[1][6] = c[CHAIN_K_E] / m_C;
    matrix[3][0] = c[CHAIN_K_C] / m_H;
    matrix[3][1] = c[CHAIN_C_C] / m_H;
    matrix[3][2] = -(c[CHAIN_K_C] + c[CHAIN_K_L]) / m_H;
    matrix[3][3] = -(c[CHAIN_C_C] + c[CHAIN_C_L] + c[CHAIN_C_H]) / m_H;
    matrix[3][4] = c[CHAIN_K_L] / m_H;
    matrix[3][5] = c[CHAIN_C_L] / m_H;
    matrix[3][7] = c[CHAIN_B_H] / m_H;
    matrix[5][2] = c[CHAIN_K_L] / m_M;
    matrix[5][3] = c[CHAIN_C_L] / m_M;
    matrix[5][4] = -(c[CHAIN_K_L] + c[CHAIN_K_W]) / m_M;
    matrix[5][5] = -(c[CHAIN_C_L] + c[CHAIN_C_W]) / m_M;
    matrix[5][7] = c[CHAIN_B_M] / m_M;
}

/* Kept in one place: unrolled, a product is two kilobytes. */
#if defined(__GNUC__)
#define CHAIN_ALONE __attribute__((noinline))
#else
#define CHAIN_ALONE
#endif

/* result = left right for matrices whose last two rows are zero and are not stored */
static CHAIN_ALONE void chain_product(
    double left[CHAIN_STATES][CHAIN_SIZE], double right[CHAIN_STATES][CHAIN_SIZE], double result[CHAIN_STATES][CHAIN_SIZE]) {
    int i, j, k;
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) result[i][j] = 0.0;
        for (k = 0; k < CHAIN_STATES; ++k) {
            for (j = 0; j < CHAIN_SIZE; ++j) result[i][j] += left[i][k] * right[k][j];
        }
    }
}

/* Largest sum of sizes of a row over the first `columns`. */
RARE double chain_norm(double matrix[CHAIN_STATES][CHAIN_SIZE], int columns) {
    double largest = 0.0;
    int i, j;
    for (i = 0; i < CHAIN_STATES; ++i) {
        double sum = 0.0;
        for (j = 0; j < columns; ++j) sum += matrix[i][j] < 0.0 ? -matrix[i][j] : matrix[i][j];
        if (!(sum <= largest)) largest = sum; /* NaN is kept */
    }
    return largest;
}

/* x <- exp(x) - I: the Taylor series of x / 2^d, then d times e <- 2 e + e e. Without the I, small numbers keep digits. */
RARE void chain_exponential(double x[CHAIN_STATES][CHAIN_SIZE]) {
    double sum[CHAIN_STATES][CHAIN_SIZE], product[CHAIN_STATES][CHAIN_SIZE];
    double norm = chain_norm(x, CHAIN_SIZE), factor = 1.0;
    int doublings = 0, i, j, k;
    for (; norm > 0.5 && doublings < 1000; ++doublings) {
        norm *= 0.5;
        factor *= 0.5;
    }
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) {
            x[i][j] *= factor;
            sum[i][j] = x[i][j] / (double)CHAIN_TERMS;
        }
    }
    for (k = CHAIN_TERMS - 1; k > 0; --k) { /* sum = x/k (I + x/(k+1) (I + ...)) */
        chain_product(x, sum, product);
        for (i = 0; i < CHAIN_STATES; ++i) {
            for (j = 0; j < CHAIN_SIZE; ++j) sum[i][j] = (x[i][j] + product[i][j]) / (double)k;
        }
    }
    for (; doublings > 0; --doublings) {
        chain_product(sum, sum, product);
        for (i = 0; i < CHAIN_STATES; ++i) {
            for (j = 0; j < CHAIN_SIZE; ++j) sum[i][j] = 2.0 * sum[i][j] + product[i][j];
        }
    }
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) x[i][j] = sum[i][j];
    }
}

/* Whether some power A^(2^k) of the scaled system matrix has a norm below one: then, and only then, A^n goes to zero. */
RARE int chain_decays(double step[CHAIN_STATES][CHAIN_SIZE]) {
    double power[CHAIN_STATES][CHAIN_SIZE], product[CHAIN_STATES][CHAIN_SIZE];
    int squaring, i, j;
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) power[i][j] = j < CHAIN_STATES ? step[i][j] + (i == j ? 1.0 : 0.0) : 0.0;
    }
    for (squaring = 0; squaring < CHAIN_SQUARINGS; ++squaring) {
        double norm = chain_norm(power, CHAIN_STATES);
        if (norm < 1.0) return 1;
        if (!(norm < 1e100)) return 0;
        chain_product(power, power, product);
        for (i = 0; i < CHAIN_STATES; ++i) {
            for (j = 0; j < CHAIN_STATES; ++j) power[i][j] = product[i][j];
        }
    }
    return 0;
}

/* g: the springs alone, positions per metre of eta; velocities rest. 1 = they hold nothing. */
RARE int chain_rest(const double *c, double *g) {
    double stiffness[9] = {c[CHAIN_K_E] + c[CHAIN_K_C], -c[CHAIN_K_C], 0.0, -c[CHAIN_K_C], c[CHAIN_K_C] + c[CHAIN_K_L],
                           -c[CHAIN_K_L], 0.0, -c[CHAIN_K_L], c[CHAIN_K_L] + c[CHAIN_K_W]};
    double position[3] = {c[CHAIN_K_E], 0.0, 0.0};
    int failed = linear_solve(stiffness, 3, position), i;
    for (i = 0; i < 3; ++i) {
        g[2 * i] = position[i];
        g[2 * i + 1] = 0.0;
    }
    return failed;
}

/* A[column][row], B[column][row] and g of one chain; CHAIN_... */
RARE int chain_discretised(const double *c, double sample_time, double *A, double *B, double *g) {
    double matrix[CHAIN_STATES][CHAIN_SIZE];
    int i, j;
    chain_continuous(c, matrix);
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) matrix[i][j] = matrix[i][j] * sample_time * (chain_scale[j] / chain_scale[i]);
    }
    chain_exponential(matrix);
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) {
            double value = matrix[i][j] * (chain_scale[i] / chain_scale[j]);
            if (j < CHAIN_STATES) A[j * CHAIN_STATES + i] = i == j ? 1.0 + value : value;
            else B[(j - CHAIN_STATES) * CHAIN_STATES + i] = value;
        }
    }
    if (chain_rest(c, g)) return CHAIN_NO_REST;
    return chain_decays(matrix) ? CHAIN_FINE : CHAIN_UNSTABLE;
}

/* A[K][6][6], B[K][2][6] (by columns) and g[K][6] for head[4] and theta[M][P]. CHAIN_FINE, or what is wrong at *node; what
   was written until then is no table. */
RARE int chain_table(
    const ChainTables *t, const double *head, const double *theta, double *A, double *B, double *g, int *node) {
    double c[CHAIN_COEFFICIENTS];
    int k, answer = CHAIN_FINE;
    for (k = 0; k < t->nodes && answer == CHAIN_FINE; ++k) {
        *node = k;
        chain_coefficients(t, head, theta, t->weights + k * t->local_models, c);
        answer = chain_discretised(
            c, t->sample_time, A + k * CHAIN_STATES * CHAIN_STATES, B + k * CHAIN_INPUTS * CHAIN_STATES,
            g + k * CHAIN_STATES);
    }
    return answer;
}

/* Where the wire stands when the contact spring is another one: at rest the frame below stands still at position
   values[row][0] = xi, pushed by k_E (xi - eta) = k_new (xi - eta_new); ratio = k_E / k_new. 1 = the heights do not rise any
   more: on so soft a spring the force at rest changes faster with the height than the spring gives way. */
RARE int chain_map_positions(
    const double *positions, const double *values, int outputs, int rows, double ratio, double *moved) {
    int row, rising = 1;
    for (row = 0; row < rows; ++row) {
        double xi = values[row * outputs];
        moved[row] = xi - (xi - positions[row]) * ratio;
        rising = rising && (row == 0 || moved[row] > moved[row - 1]);
    }
    return !rising;
}

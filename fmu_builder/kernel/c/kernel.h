/* The local linear model network (LLMN): tables, state, equations. This is the only place its arithmetic exists;
   fmu_builder/kernel/specification.py says the same in scalar Python and is compared with it bit by bit.

   Notation: n states, m inputs, p outputs, R derived outputs, M local models; tick t_n -> t_n+1 with the inputs u_n that
   were in force at t_n; s_n the scheduling input among them; r = s clipped to the range; phi_i(r) the weights.

   Deviation in the schedule, for parameters blended from a node table about a scheduled equilibrium:
     r = s_n + kappa (C x)_j clipped to the range, (C x)_j being the deviation of output j from rest as of the last tick;
   kappa = 0 leaves it out.

   Weights (thesis eq. 3.10-3.11). Gaussian: phi_i = exp(l_i - max l) / sum_k exp(l_k - max l) with the parabolas
     l_i = (curvature_i d + slope_i) d + constant_i, d = r - middle of the range;
   a term common to all l_i is left out (it cancels), so equal widths give straight lines. All other kinds: linear
   interpolation in the node table. "Active models" are the models a blend of parameters consists of, with weights w_a:
   all M with phi_i for Gaussians, the two nodes around r (1 - f and f) for a node table.

   Parameter blending (thesis eq. 3.100-3.101): one state x, matrices sum_a w_a A_a and so on.
   Output blending (thesis eq. 3.98): a state x_i per local model, y = sum_i phi_i y_i.

   Offsets, written for parameter blending; with output blending every local model uses its own A, B, C, g, x0, u0, y0:
     none                   x <- A x + B (u - u_op)                               y = y_op + C x
     affine (3.33-3.34)     x <- A (x - x0) + B (u - u0)                          y = y0 + C (x - x0)
     low_pass               l <- l + gain (s - l), r from l, B acts on s - l and on the other u - u_op
                            x <- A x + B (s - l, u - u_op)                        y = y_e(l) + C x
     scheduled_equilibrium  x <- x - 1/2 (g(r_n) + g(r_n-1)) (s_n - s_n-1)        rebase to the equilibrium of s_n
                            x <- A x + B_other (u - u_op)                         y = y_e(s_n) + C x
   where A, B, C, g, x0, u0, y0 stand for the blends at r_n (a blend is never inverted: g is blended), y_e is the static
   map, linear between its points and continued by its end segments.

   Feedthrough: y + D (u - u_ref) with the inputs set last; D is the blend of the last tick, u_ref = u_op, for low_pass l in
   the place of the scheduling input, for affine u0. Derived outputs: sum of coefficient * signal over outputs and inputs,
   the inputs being those set last.

   Certificate of stability: it holds while r moves by at most the certified move d per tick. outside rises with the first
   tick that has |r_n - r_n-1| > d and stays; beyond the range, where r stands still, nothing raises it. At the start 0.

   Start: the steady state for the inputs, from (I - A) x = right-hand side by Gaussian elimination with row pivoting;
   with kappa repeated with the deviation found, until it stays or KERNEL_START_PASSES are done.

   Small numbers: at a tick, states, l and Gaussian weights below KERNEL_SMALLEST in size become zero, so that a model at
   rest computes as fast as a model in motion: there are no denormal numbers in it, and products with them stay normal.

   A contact that can open gives these equations other inputs: contact.c. Where they were trained: region.c.

   Order: sums run over the index, matrices are applied model by model and then weighted: sum_a w_a (A_a x + B_a u). */

#ifndef KERNEL_H
#define KERNEL_H

enum { BLENDING_OUTPUT = 0, BLENDING_PARAMETER = 1 };
enum { KERNEL_START_PASSES = 100 };
enum { OFFSETS_NONE = 0, OFFSETS_AFFINE = 1, OFFSETS_LOW_PASS = 2, OFFSETS_SCHEDULED_EQUILIBRIUM = 3 };

/* What all tables of a network have in common. In an FMU it is taken from the constants of its binary, so that the compiler
   knows the sizes (all.c, blended.c, surrogate.c). */
#ifndef FIXED
#define FIXED(tables, field) ((tables)->field)
#endif

#define KERNEL_SMALLEST 1e-100       /* far below the last digit of any signal, far above the smallest normal number */
#define KERNEL_LOG_SMALLEST (-230.0) /* exp of it is about KERNEL_SMALLEST */

/* A network as numbers. Matrices are stored by columns: A[model][column][row]; an array that is not needed may be null. */
typedef struct {
    int states;                /* n */
    int inputs;                /* m */
    int outputs;               /* p */
    int derived;               /* R */
    int local_models;          /* M */
    int models;                /* rows of A..y0: M, or the nodes K when parameters are blended from a node table */
    int output_models;         /* rows of C: models, or 1 where C is the same in all */
    int nodes;                 /* K; 0 = Gaussians */
    int map_points;            /* L; 0 = no static map */
    int blending;              /* BLENDING_... */
    int offsets;               /* OFFSETS_... */
    int scheduling;            /* index of the scheduling input */
    int feedthrough;           /* 1 = some D is not zero */
    int deviation_output;      /* j: the output whose deviation also schedules */
    int watched;               /* 1 = some derived output has trained limits */
    double range_low;          /* ends of the range, unit of the scheduling input */
    double range_high;
    double range_middle;
    double low_pass_gain;      /* 1 - exp(-2 pi f Ts) */
    double node_scale;         /* (K - 1) / width: first guess of the cell */
    double map_scale;          /* (L - 1) / width */
    double deviation_gain;     /* kappa; 0 = only the scheduling input schedules */
    double certified_move;     /* d; 0 = no certificate that depends on how far r moves */
    double trained_move;       /* furthest that s has moved in a tick of training; the largest number where nobody knows */
    const double *log_weights;             /* [M][3]: constant, slope, curvature */
    const double *node_positions;          /* [K] */
    const double *node_weights;            /* [K][M] */
    const double *map_positions;           /* [L] */
    const double *map_values;              /* [L][p] */
    const double *A;                       /* [models][n][n] */
    const double *B;                       /* [models][m][n] */
    const double *C;                       /* [output_models][n][p] */
    const double *D;                       /* [models][m][p]; null without feedthrough */
    const double *g;                       /* [models][n]: (I - A)^-1 B_scheduling */
    const double *x0;                      /* [models][n] */
    const double *u0;                      /* [models][m] */
    const double *y0;                      /* [models][p] */
    const double *input_operating_point;   /* [m] */
    const double *output_operating_point;  /* [p] */
    const double *input_minimum;           /* [m] seen in training; of s within the range */
    const double *input_maximum;           /* [m] */
    const double *derived_minimum;         /* [R] seen in training, the largest numbers where nobody knows; null if not watched */
    const double *derived_maximum;         /* [R] */
    const double *term_coefficients;       /* [terms] sign * parameter, all derived outputs one after the other */
    const int *term_signals;               /* [terms] 0..p-1 outputs, p..p+m-1 inputs */
    const int *term_ends;                  /* [R] one past the last term of each derived output */
} Tables;

/* The parts of the state array; the last line is scratch that carries nothing from call to call. */
typedef struct {
    double *x;                 /* [n], or [M][n] with output blending */
    double *weights;           /* [M] phi of the last tick */
    double *held;              /* [p] outputs without feedthrough, as of the last tick */
    double *feedthrough;       /* [m][p] blended D of the last tick */
    double *g_held;            /* [n] blended g of the last tick */
    double *scheduling_held;   /* [1] scheduling input of the last tick */
    double *low_pass;          /* [1] l */
    double *deviation_held;    /* [1] (C x)_j of the last tick; 0 without kappa */
    double *in_range;          /* [1] 1.0 when the last tick lay in the trained region (region.c), else 0.0 */
    double *scheduling_given;  /* [1] scheduling input of the last tick before a contact acts on it (region.c) */
    double *position;          /* [1] r of the last tick */
    double *outside;           /* [1] 1.0 when a tick has moved r further than is certified, else 0.0 */
    double *pair, *deviation, *x0, *u0, *shift, *product, *next, *matrix;
} KernelView;

/* The models a blend of parameters consists of: count models from the first, with their weights. */
typedef struct {
    int first;
    int count;
    const double *weights;
} KernelBlend;

#endif

"""The one table of tolerances: every row says why it is as large as it is."""

BITS = 0.0  # the same arithmetic in the same order: nothing may differ
SURROGATE_EXPONENTIAL = 1e-14  # of the largest entry: a few roundings against 40 digits
CHAIN_TABLE = 1e-13  # of the largest entry: asked for; eight doublings round to 1e-14
SURROGATE_EQUILIBRIUM = 1e-11  # m per m: a linear solve with condition 1e5 rounds there
MESSAGE_DIGITS = 6e-6  # relative: six significant digits in a log message, half a unit of the last one
SURROGATE_RECURSION = 1e-10  # of the signal's size: two orders of summation over hundreds of ticks
SURROGATE_SENSITIVITY = 1e-9  # of the largest entry: complex steps through a dense simulation, same rounding
SURROGATE_RECOVERY = 1e-6  # relative, noise-free: asked for; about 1e-11 is reached
EXACT_CHAIN = 1e-8  # relative: asked for; a change of coordinates with condition 1e4 reaches 1e-12
CLOSED_FORM = 1e-5  # relative: a rational fit of order 4/2 on exact responses; weak dampers are the worst
RESONANCE_DIGITS = 0.006  # Hz: the reference tables print two or three decimals
LINEARISED_POLES = 1e-9  # in the z plane: two ways to the matrix exponential, real parts sorted alike
LINEARISED_REST = 1e-6  # N, m, m/s: a rest point by (I - A)^-1, seen through a contact of 1e5 N/m
SPLINE_HEIGHT = 2e-6  # m, and of a cost: a minimum of a square is found to the root of a rounding
HEIGHT_SCATTER = 0.12  # relative: a standard deviation from 400 draws scatters by 3.5 %
FREQUENCY_SCATTER = 0.15  # relative: 400 draws scatter by 3.5 %, the formula leaves out terms of the damping
SURFACE = 1e-6  # of the largest entry of a spectrum: one row at rest before the step leaves roundings
STATIC_FORCE = 0.1  # N: the reference prints one decimal
DRIFT = 0.001  # m: the reference prints three decimals
SLOPE = 0.0006  # N/(N.m): the reference prints three decimals
CRITICAL_TORQUE = 0.6  # N.m: the reference prints no decimals
LAST_DIGIT = 0.06  # of figures printed with one decimal
POLE = 1.5e-6  # the reference prints six decimals of poles in the z plane
POLE_FREQUENCY = 0.0006  # Hz: printed with three decimals
POLE_DAMPING = 0.00006  # printed with four decimals
MEAN_DAMPING = 0.0006  # printed with three decimals
ELEMENTARY_ULP = 1.0  # units of the last place: what elementary.c promises for exp, log, sin and cos
TANH_ULP = 2.5  # units of the last place: a quotient of a sum, each rounded; 2.26 is seen
WBM_EQUATIONS = (
    1e-12  # of the largest entry: closed forms against acos/atan2, rounding grows at the dead centres
)
WBM_TANGENT = 1e-12  # of the largest entry: an exact derivative, only its roundings are left
WBM_REST = 1e-9  # m/s2, rad/s2: forces of 1e5 N per metre are balanced to their last digit
WBM_LEAST_ORDER = 4.0  # a classical Runge-Kutta step of fourth order; the energy gains one order more
WBM_ORDER = 0.5  # measured orders scatter while the coarsest step still feels the next term
WBM_ENERGY = 1e-7  # of the energy: a quarter of a millisecond over half a second leaves 1e-8 to 8e-8
WBM_STATIC_GAIN = 1e-9  # of the largest of its row: six equations against three, condition 1e6
WBM_INTEGRATORS = (
    1e-5  # of an output's span, of millimetres: CVode keeps 1e-9 m and 1e-9 m/s per step; 3e-6 is seen
)
STATE_EVENT = 1e-11  # of a state: CVode brackets a root to a few 1e-14 s; 1e-13 is seen
WBM_BOUNCE = 3e-8  # of a state's span: DOP853 with 1e-10 steps over the kinks; 1.4e-8 is seen with friction
WBM_BOUNCE_INTEGRATORS = (
    3e-5  # of an output's span in a second of bounces: every touch widens what CVode lets pass; 1e-5 is seen
)
WBM_BOUNCE_ENERGY = 1e-6  # J of some hundred in 1.5 s: a quarter of a millisecond leaves 2e-7 and 4e-7
LIFTED_NETWORK = 0.01  # of the span of xi in 0.3 s: a linearisation, 9 cm above its point; 0.9 % is seen
HYSTERESIS = 0.05  # relative: asked for; what the arms' own bend adds, 1.4 % is seen
HYSTERESIS_WITHOUT = 0.001  # of the hysteresis with friction: the rest of a swing, averaged over four seconds
CONTACT_BAND = (
    0.001  # of an amplitude: a Butterworth filter twice, two octaves inside and one and a half outside
)
SINE_RESPONSE = (
    0.002  # relative: peak to peak of a thousand samples, transients decay below this in three seconds
)
FRICTION_STEP = 2.7  # step times decay rate: 2.5 is aimed at with an unbent knee, 2.785 is the limit
SIMULATION = 1e-11  # of the largest output: blocks of rows instead of rows, other order of summation
RMS_SCALING = 1e-14  # relative: one division and one square root
HALF_POWER = 0.04  # relative: spectrum of two million samples, 240 windows and a few bins
LEVEL_SPREAD = 0.02  # relative: standard deviation of some thousand uniform levels
NOISE_FREE_FIT = 1e-6  # percentage points: what rounding leaves of 100 %
SHIPPED_SCORE = 1e-9  # percentage points, relative errors: the same bits, norms summed in another order
OTHER_RECORD = 1.3  # error against the committed one: eight records of 120 s scatter by 20 % about their mean
NOISE_FREE_POLE = 1e-9  # in the z plane: least squares in double precision
NOISY_FIT = (
    0.02  # percentage points: the prototype is at 99.992 or better, one seed; five seeds scatter by this
)
INVARIANCE = 1e-7  # relative change of a frequency response: other scaling, other order of summation
EQUILIBRIUM_NETWORK = (
    1e-9  # of the largest deviation: (I - A)^-1 with condition 1e4 and a table of rest points
)
ALIGNMENT = 1e-9  # relative: a pseudo-inverse of an observability matrix with condition 1e4
STATIC_REGRESSION = 0.002  # m/m: what is dynamic does not quite average out in 60 s
ZERO_ORDER_HOLD = 1e-12  # relative: expm against expm
HELD_INPUT_BIAS = 0.02  # relative: the mean over two seconds still holds a rest of the swing
FIRST_OUTPUT_NEWTON = 0.5  # N (1e-5 of it in m and m/s): 41 points of a static map, straight lines in between
KERNEL_VECTORISED = 1e-12  # of the largest output: matrix products and libm's exp round in another order
STAYS_AT_REST = 1e-9  # of the largest number in the steady state: solved by elimination, condition up to 1e4
SAME_NETWORK = 1e-10  # of the largest output: two ways to write one network, rounding over hundreds of ticks
WEIGHT_SUM = 1e-15  # a few roundings of numbers that sum to 1; node tables hold rounded rows
SETTLED = 1e-9  # m and m/s: a steady state stays put over 5000 ticks
SPECTRUM_POWER = 0.01  # relative: Hann windows over a sine that ends between two lines
CUBIC_WEIGHTS = 1e-9  # of the largest weight: a spline through centres as near as 0.1 of the range
NODE_WEIGHTS = 0.015  # straight lines between 81 nodes: h^2 / 8 times the curvature of a warped cubic
TUNED_NUMBER = 1e-4  # relative: the search ends when the cost, a square, no longer falls
SAME_SEARCH = 1e-5  # of the std of an output: rounding over the step of a difference, 1e-4, and some steps
FACTORISATION = 1e-8  # relative: QR against Cholesky of the covariance, whose condition number is squared
DEVIATION_SCHEDULE = 1e-10  # of the largest output: rounding feeds back through the schedule for 120 ticks
HANKEL = 1e-7  # of the largest: Gramians in double precision know Hankel singular values to the root of that
GLOVER = 1e-6  # relative: Glover's bound on a grid of frequencies, singular values from Gramians
STATIC_GAIN = 1e-6  # relative: (I - A)^-1 after a change to balanced coordinates
STEADY_GAIN = 1e-10  # of the largest of its row: two linear solves of condition 1e3, complex steps are exact
OCTAVE_POLE = 1e-4  # in the z plane: two estimators on the same 20 s of noisy data; 1e-5 is reached
OUTPUT_PARTITION = 0.01  # m/m: the contact spring takes up what the force at rest changes with the height
SCATTER = 0.3  # natural log: 50 seeds know a standard deviation to 10 %, the largest of 16 to 25 %
FEW_SEEDS = 0.7  # natural log: 12 seeds know a standard deviation to 21 %, the largest of 8 to 60 %
JACKKNIFE = (
    0.7  # natural log: ten groups know a standard deviation to 25 %, 12 seeds to 20 %, of eight the largest
)
SELF_COMPILED = (
    1e-9  # of an output's largest size: fused multiply-adds over 120 ms, forces are differences of 1e5 N
)
IMPORTER_INTERPOLATION = 1e-12  # of the signal's size: between equal values fmpy's inputs round with its time
TRIANGLE = 1e-12  # relative: products of a few matrices of numbers of order one
FOUR_DIGITS = 5.1e-4  # relative or absolute about 1: error bands are printed with four digits
TONE_PHASE = 0.003  # rad, and of 1: a straight line through three periods of a tone takes so much of it
TONE_SHARE = 1e-3  # of 1: the bilinear transform bends 5 Hz of 1 kHz by 1e-4; ends are far away
BANDS_ADD_UP = 1e-12  # of the largest part: one subtraction and one sum per edge
NOISE_QUANTILE = (
    0.12,
    0.06,
    0.04,
    0.01,
    0.01,
)  # relative, per band and for all: 2 x width x 235 s independent numbers know a quantile so well
ARX_RECOVERY = 1e-9  # relative: noise-free least squares, condition number of some thousands
LEAST_SQUARES = 1e-12  # relative: two orthogonal solutions of a well-conditioned problem
SAME_FREE_RUN = 1e-4  # percentage points: poles near 1 magnify the rounding of sums of lags
FMPY_LOOP = 1e-9  # of an output's span: fmpy interpolates inputs between the rows it stands on, to rounding
RECOMPUTED_FIT = 1e-9  # percentage points: the same outputs, norms summed in another order

/* One step of the thermal controller: from temperatures and requested currents to the closest admissible currents.
 *
 * sizes.h gives LPTN_NX states (the first LPTN_NN are nodes with a sensor), LPTN_NU joints, LPTN_ND conditions,
 * LPTN_NP parameters, LPTN_NL limited nodes, LPTN_N stages. No heap, no globals, no input or output: all memory is in the
 * structs. A request is a torque [N*m] or a current [A], as sizes.h says; over a stage it is the RMS value. */
#ifndef LPTN_MPC_H
#define LPTN_MPC_H
#include "sizes.h"
#ifdef __cplusplus
extern "C" {
#endif

#define LPTN_SHORTCUT 1    /* the full request stays cool; nothing was solved */
#define LPTN_UNMEASURED 2  /* a reading was missing or absurd: the prediction stood in for it */
#define LPTN_NO_REQUEST 4  /* a request was no number: taken as zero */
#define LPTN_CURRENT_CUT 8 /* a request lies above the current limit */
#define LPTN_TOO_HOT 16    /* a bound can't be met everywhere: see the slack */
#define LPTN_NOT_BEST 32   /* the solver did not converge: the best plan that it met, which may not be the optimum */
#define LPTN_NO_CONDITION 64 /* a condition was no number: the last good one stood in for it, else zero; with a power limit, no
                                more than its floor for a joint whose power depends on one that never was good */
#define LPTN_NOT_ALIVE 128 /* a sensor is not alive: the prediction stood in for it; `sensor` says which */
#define LPTN_OVER_POWER 256 /* the power limit can't be met: floors, rates, or the least heat scale */

/* Of a sensor: is taken in, gave no reading, repeats itself, contradicts the model, has not yet moved as the model does. */
enum { LPTN_ALIVE, LPTN_MISSING, LPTN_STANDS, LPTN_CONTRADICTS, LPTN_UNPROVEN };
/* What happens to a joint whose node has lost its sensor: the model goes on; as if the node were at its limit; no torque. */
enum { LPTN_MODEL, LPTN_DERATE, LPTN_STOP };

#define LPTN_NE (LPTN_NN + LPTN_NK)
#define LPTN_NS (LPTN_NX + LPTN_NE)
/* Filters: by no reading; by the sensors that are not lost; by these and a lost one that is tested; what is planned from. */
enum { ALONE, USED, RETURNS, ESTIMATE };

/* What does not change from step to step. */
typedef struct {
    double stage[LPTN_N];       /* lengths [s]; the first is the control period */
    double limit[LPTN_NL];      /* degC, the fixed margin taken off */
    int node[LPTN_NL];          /* which state each limit is for */
    int owner[LPTN_NX];         /* node that a state belongs to */
    double weight[LPTN_NU];     /* of a squared deviation of each joint */
    double most[LPTN_NU];       /* current limit [A] */
    double rate[LPTN_NU];       /* largest change of a request's unit per second; 0 for none */
    double floor[LPTN_NU];      /* of the request's unit that a joint gets whatever gets hot, if so much is asked */
    double p[LPTN_NP + 1];      /* parameters of the model; by how much what surrounds it is warmer than told, LPTN_NT [K] */
    int unsure[LPTN_NK];        /* those of them that a robot has of its own: all that rates depend on, the last LPTN_NT too */
    double unit[LPTN_NK];       /* their values, standard errors of those that are 0, of the last an absolute temperature [K]: p
                                   is that + unit (exp(z) - 1) */
    double recovery[LPTN_NL];   /* time constant with which a node above its limit comes down to it [s]; 0: at once */
    double smoothing;           /* time constant with which a joint's share rises, while the same is asked [s] */
    double linear, quadratic;   /* price of slack, per K and per K^2; the cost of admitting nothing at all is 1 */
    double noise;               /* of a reading, its rounding included, standard deviation [K] */
    double grain;               /* of the rounding alone, which no averaging removes [K] */
    double sigmas;              /* standard deviations of the estimate that are kept as a margin at least */
    double error[2][LPTN_NE];   /* standard deviations of what sets a robot apart from its model, of the estimate and where
                                   sensors are tested: heat that each node lacks [K/s], logarithms of the parameters */
    double settles[LPTN_NN];    /* time in which a node forgets how warm all began [s] */
    double tolerance;           /* on the duality gap */
    int iterations, warm;       /* at most; the first `warm` of them from the last plan, the others from a cold start */
    int learns;                 /* whether there is an estimate; else readings are taken as they are */
    int lost_sensor;            /* LPTN_MODEL, LPTN_DERATE or LPTN_STOP */
    double power;               /* limit of all joints together at the supply [W]; of account where LPTN_NR is above LPTN_NL */
} lptn_mpc_settings;

/* What is remembered of each sensor. */
typedef struct {
    double clock;                         /* s since the first step */
    double last[LPTN_NN], since[LPTN_NN]; /* last reading [degC]; s of the clock: the first of those that are like it */
    double evidence[LPTN_NN];             /* that it stands: what the chance of its repeated readings multiplies to, -log */
    double grain[LPTN_NN];                /* smallest move so far [K], infinite for none */
    double moves[LPTN_NN], due[LPTN_NN];  /* moves seen, and to be expected */
    double agreed_for[LPTN_NN];           /* s for which it has agreed with its reference */
    double regression[LPTN_NN][6];        /* its readings and its reference since then: count, means, sums of squares */
    double contradicted_for[LPTN_NN];     /* s for which it contradicted its reference before,
                                             less those for which it has been trusted again */
    double last_seen[LPTN_NN];            /* s of the clock: its last reading */
    int stands[LPTN_NN], agrees[LPTN_NN]; /* repeats itself bit for bit; agrees with its reference */
    int proven[LPTN_NN], trusted[LPTN_NN], lost[LPTN_NN]; /* has moved as the reference did; counts as alive; was found
                                                             not to be, and has not come back */
} lptn_mpc_sensors;

/* Readings that drift by a constant rate: what a rate of 1 K/s has done to a filter, and what is known of it. */
typedef struct {
    double z[LPTN_NS], seconds; /* to its z; for so long */
    double weight, score;       /* sums over readings of g^2 / s^2 and g v / s^2: innovation v, its variance s^2, and what the rate adds, g */
} lptn_mpc_drift;

/* A filter of the robot. z: its temperatures [degC], the heat that each node lacks [K/s], and the logarithms of its parameters over the
 * model's. */
typedef struct {
    double z[LPTN_NS], spread[LPTN_NS][LPTN_NS]; /* and its covariance */
    double evidence[LPTN_NN];                    /* that a sensor is false, as log likelihood ratio */
    lptn_mpc_drift drift[LPTN_NN + 1];           /* of each sensor, and of all alike */
} lptn_mpc_filter;

/* What is kept between steps; all zero before the first. */
typedef struct {
    lptn_mpc_filter filter[4];
    int returning;                       /* which sensor is tested */
    double raised[LPTN_NX];              /* how much of the estimate comes from the controlled heat since its node began [K] */
    double steady[LPTN_NX];              /* rate at which currents heat it, for what has settled within [K/s] */
    double coldest;                      /* of all that surrounded the robot, and of sensors that live as they began [degC] */
    double hotter[LPTN_NX];              /* by how much each is hotter if nodes that no sensor tells began as hot as allowed [K] */
    double returns[LPTN_NN];             /* of a sensor that came back: error without it, by the time that it has to agree [K/s] */
    int read[LPTN_NN], guessed[LPTN_NN]; /* how often its sensor began, 0 for never read; no sensor tells its node */
    int once_trusted[LPTN_NN], used[LPTN_NN]; /* its sensor was trusted once; was used since its reference was set */
    double applied[LPTN_NU], conditions[LPTN_ND + 1];
    int known[LPTN_ND + 1];           /* conditions that have been good once */
    double scale[LPTN_N][LPTN_NU];    /* of the heat, as solved last */
    double asked[LPTN_NU], share[LPTN_NU]; /* request of the last period, and the share of it that was admitted */
    int started;
    lptn_mpc_sensors sensors;
} lptn_mpc_state;

typedef struct {
    double admitted[LPTN_NU];        /* for the coming control period, in the request's unit */
    double plan[LPTN_N][LPTN_NU];    /* for each stage */
    double x[LPTN_N + 1][LPTN_NX];   /* expected at the stages' ends [degC] */
    double slack[LPTN_N][LPTN_NL];   /* by how much each limit less its margin is passed [K] */
    double power[LPTN_N];            /* of all joints together at the supply [W], NaN without a limit */
    double margin[LPTN_NL];          /* of this step, for what is not known [K] */
    double cost, worst, error, gap;  /* cost, 1 for admitting nothing; largest slack [K]; by how much a stage's
                                        end misses the next one's start [K], or its power changes, as a share of its limit,
                                        at the last linearisation, whichever number is larger; duality gap */
    int iterations, linearisations, status;
    double doubt[LPTN_NN]; /* by how much a node is planned hotter than its sensor says, since the model expects it [K] */
    int sensor[LPTN_NN];   /* LPTN_ALIVE, or why the prediction stood in for the reading */
} lptn_mpc_result;

/* A stage, x+ = x + F (k + A x + B s); of A and B what may not be zero, at the places that pattern.h tells. */
typedef struct {
    double F[LPTN_NXP][LPTN_NXP], k[LPTN_NX], A[LPTN_NA + 1], B[LPTN_NB + 1];
} lptn_mpc_stage;

typedef struct {
    lptn_mpc_stage stage[LPTN_N];
    double U[LPTN_N][LPTN_NU][LPTN_W], v[LPTN_N][LPTN_W];            /* eliminated controls */
    double square[4][LPTN_NXP][LPTN_NXP], form[LPTN_NU + LPTN_NX][LPTN_W], right[LPTN_NX][LPTN_W]; /* of one stage */
    double a[LPTN_N][LPTN_NU], c[LPTN_N][LPTN_NU], d[LPTN_N][LPTN_ND + 1];
    double s[LPTN_N][LPTN_NU], lo[LPTN_N][LPTN_NU], hi[LPTN_N][LPTN_NU], zl[LPTN_N][LPTN_NU], zu[LPTN_N][LPTN_NU];
    double ds[LPTN_N][LPTN_NU], dl[LPTN_N][LPTN_NU], du[LPTN_N][LPTN_NU], cl[LPTN_N][LPTN_NU], cu[LPTN_N][LPTN_NU];
    double t[LPTN_N][LPTN_NR], y[LPTN_N][LPTN_NR], e[LPTN_N][LPTN_NR], z[LPTN_N][LPTN_NR];
    double dt[LPTN_N][LPTN_NR], dy[LPTN_N][LPTN_NR], de[LPTN_N][LPTN_NR], dz[LPTN_N][LPTN_NR];
    double ct[LPTN_N][LPTN_NR], ce[LPTN_N][LPTN_NR], row[LPTN_N][LPTN_NR];
    double R[LPTN_N][LPTN_NU], r[LPTN_N][LPTN_NU], Q[LPTN_N][LPTN_NR], q[LPTN_N][LPTN_NR];
    double power[LPTN_N], by_scale[LPTN_N][LPTN_NU]; /* of all joints at scales of 0, and its slopes, over the limit */
    double x[LPTN_N + 1][LPTN_NX], dx[LPTN_N + 1][LPTN_NX];
    double gap[LPTN_N][LPTN_NX], P[LPTN_N][LPTN_NX][LPTN_NXP]; /* x+ less the next stage's x; cost to go */
    double bias[LPTN_NN], limit[LPTN_N][LPTN_NR]; /* missing heat of each node [K/s] */
    double best[LPTN_N][LPTN_NU], least;  /* the best scales that were met, and their price */
    double heat[LPTN_HEAT_OUT], casadi[LPTN_HEAT_W + 1];
    double start[LPTN_NX];                               /* temperatures that are planned from [degC] */
    int stopped[LPTN_NU];                                /* joints that get nothing but their floor */
    double p[LPTN_NP + 1], by[LPTN_NX][LPTN_NK];                      /* parameters that are tried, and slopes by them */
    double G[LPTN_NX][LPTN_NS], moved[LPTN_NX][LPTN_NS];            /* of one period, by z; times the covariance of z */
} lptn_mpc_work;

/* One control period.
 *
 * measured: LPTN_NN readings [degC], NaN where there is none. request: LPTN_N x LPTN_NU, RMS over each stage.
 * conditions: LPTN_N x LPTN_ND, the model's other inputs. applied: LPTN_NU, what was really applied over the last
 * period; NULL where it was what had been admitted. Never fails: `result->status` says what was given up. */
void lptn_mpc_step(const lptn_mpc_settings *settings, lptn_mpc_state *state, lptn_mpc_work *work, const double *measured,
                   const double *request, const double *conditions, const double *applied, lptn_mpc_result *result);
#ifdef __cplusplus
}
#endif
#endif

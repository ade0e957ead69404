/* The controller in a robot's loop: a short step at every tick, the long one in between.
 *
 * `lptn_loop_update` belongs into the fast loop (1 kHz, say). It sums squares and answers with the scales by which the
 * requests are to be multiplied: some hundred operations, always the same ones, no allocation, no system call, no wait.
 * `lptn_loop_think` solves the thermal problem once a control period, a millisecond or so. Call it after the update, or from
 * a thread of lower priority: the two hand over by one flag, and neither waits for the other. Without an answer the plan
 * that was found last goes on, stage by stage: it reaches as far as the horizon. After its end joints get nothing but their
 * floors. */
#ifndef LPTN_LOOP_H
#define LPTN_LOOP_H
#include "lptn_mpc.h"
#ifdef __cplusplus
extern "C" {
#endif

#define LPTN_LOOP_WAITING 1 /* lptn_loop_think has something to do */
#define LPTN_LOOP_LATE 2    /* it has not answered for two control periods */
#define LPTN_LOOP_OVER 4    /* nor for the whole horizon: floors only */
#define LPTN_LOOP_BLIND 8   /* a torque or current is missing, absurd or stands: the scaled request stood in for it */

/* What is kept between ticks; made by lptn_loop_begin. */
typedef struct {
    double tick;                               /* s */
    int begun, ticks, ends[LPTN_N];            /* a first tick was; ticks of a control period, and to the stages' ends */
    double asked[LPTN_NU], done[LPTN_NU];      /* sums of squares since the last handover */
    int asked_count[LPTN_NU], done_count[LPTN_NU], condition_count[LPTN_ND + 1], count;
    double around[LPTN_ND + 1];                /* sums of the conditions, or of their squares */
    double temperature[LPTN_NN];               /* last reading since the handover, NaN for none */
    double last[LPTN_NU], least[LPTN_NU], most[LPTN_NU]; /* of the torques: the last one, and the commands since it moved */
    int standing[LPTN_NU];                     /* ticks since it moved */
    double scale[LPTN_NU], plan[LPTN_N][LPTN_NU], floor[LPTN_NU]; /* now; of each stage; of the request's unit */
    int age, stage;                            /* of the plan [ticks] */
    /* Handed over to lptn_loop_think, and back. */
    double mean_asked[LPTN_NU], mean_done[LPTN_NU], mean_around[LPTN_ND + 1], reading[LPTN_NN], next[LPTN_N][LPTN_NU];
    int taken_at;                              /* age of the plan at the handover: what the next one's age begins from */
    int turn;                                  /* whose turn it is: 0 of the update, 1 of the solver, 2 an answer waits */
} lptn_loop;

/* Before the first tick, of `tick` seconds. */
void lptn_loop_begin(const lptn_mpc_settings *settings, lptn_loop *loop, double tick);

/* One tick: what is asked of the joints now, LPTN_NU; what their drives measured (NULL where they don't), LPTN_NU of the same
 * unit; temperatures, LPTN_NN; the model's other inputs, LPTN_ND. NaN where one is missing. Puts the factors, 0 to 1, for this
 * tick's requests into `scale`, LPTN_NU, and returns LPTN_LOOP_ bits. */
int lptn_loop_update(lptn_loop *loop, const double *asked, const double *applied, const double *temperatures,
                     const double *conditions, double *scale);

/* Solve for the next control period if its numbers wait; returns whether they did. Where they are known, of each stage from
 * now on: requests, RMS, LPTN_N x LPTN_NU; conditions, means, LPTN_N x LPTN_ND. NULL, or NaN in an
 * entry: as over the last period. */
int lptn_loop_think(const lptn_mpc_settings *settings, lptn_loop *loop, lptn_mpc_state *state, lptn_mpc_work *work,
                    const double *requests, const double *conditions, lptn_mpc_result *result);
#ifdef __cplusplus
}
#endif
#endif

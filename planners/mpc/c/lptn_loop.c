/* The fast half of the controller: sums between two control periods, and the scales of the plan that is followed. */
#include "lptn_loop.h"

#include <math.h>
#include <string.h>

#include "conditions.h" /* how each condition is averaged: LPTN_MEAN, LPTN_ABSOLUTE, LPTN_RMS */

#define ABSURD 1e6      /* of the request's unit; more is no number of a robot */
#define STANDS 1.0      /* s in which a torque that is alive moves, where its command does */
#define MOVED 0.1       /* of the largest command: so much must it have moved in that time */
#define LATE 2          /* control periods */
#define TRIFLE 1e-5     /* of what all requests weigh: a joint that is asked less has no scale that means something */

#if defined(__GNUC__)
#define TURN(loop) __atomic_load_n(&(loop)->turn, __ATOMIC_ACQUIRE)
#define PASS(loop, to) __atomic_store_n(&(loop)->turn, to, __ATOMIC_RELEASE)
#else /* one thread */
#define TURN(loop) ((loop)->turn)
#define PASS(loop, to) ((loop)->turn = (to))
#endif

static void forget_sums(lptn_loop *m) {
    memset(m->asked, 0, sizeof m->asked), memset(m->done, 0, sizeof m->done), memset(m->around, 0, sizeof m->around);
    memset(m->asked_count, 0, sizeof m->asked_count), memset(m->done_count, 0, sizeof m->done_count);
    memset(m->condition_count, 0, sizeof m->condition_count);
    for (int i = 0; i < LPTN_NN; i++) m->temperature[i] = NAN;
    m->count = 0;
}

void lptn_loop_begin(const lptn_mpc_settings *o, lptn_loop *m, double tick) {
    double time = 0;
    memset(m, 0, sizeof *m);
    m->tick = tick;
    for (int k = 0; k < LPTN_N; k++) {
        time += o->stage[k];
        m->ends[k] = (int)(time / tick + 0.5);
        for (int j = 0; j < LPTN_NU; j++) m->plan[k][j] = 1;
    }
    m->ticks = m->ends[0] > 0 ? m->ends[0] : 1;
    for (int j = 0; j < LPTN_NU; j++) m->scale[j] = 1, m->last[j] = NAN, m->floor[j] = o->floor[j];
    forget_sums(m);
}

static int number(double value) { return value > -ABSURD && value < ABSURD; }

/* Whether a measured torque is one: a number, and no sensor that stands while its command moves. */
static int is_alive(lptn_loop *m, int j, double measured, double command) {
    if (!number(measured)) return 0;
    if (measured != m->last[j]) {
        m->last[j] = measured, m->least[j] = m->most[j] = command, m->standing[j] = 0;
        return 1;
    }
    m->least[j] = fmin(m->least[j], command), m->most[j] = fmax(m->most[j], command);
    if (m->standing[j] * m->tick < STANDS) {
        m->standing[j]++;
        return 1;
    }
    return !(m->most[j] - m->least[j] > MOVED * fmax(fabs(m->least[j]), fabs(m->most[j])));
}

static double mean(double sum, int count) { return count ? sum / count : NAN; }

static void hand_over(lptn_loop *m) {
    for (int j = 0; j < LPTN_NU; j++) {
        m->mean_done[j] = sqrt(mean(m->done[j], m->done_count[j]));
        m->mean_asked[j] = sqrt(mean(m->asked[j], m->asked_count[j]));
    }
    for (int i = 0; i < LPTN_ND; i++) {
        const double value = mean(m->around[i], m->condition_count[i]);
        m->mean_around[i] = lptn_condition_kind[i] == LPTN_RMS ? sqrt(value) : value;
    }
    memcpy(m->reading, m->temperature, sizeof m->reading);
    forget_sums(m);
    m->taken_at = m->age;
    PASS(m, 1);
}

static void adopt(lptn_loop *m) {
    memcpy(m->plan, m->next, sizeof m->plan);
    m->age -= m->taken_at, m->stage = 0;
    PASS(m, 0);
}

int lptn_loop_update(lptn_loop *m, const double *asked, const double *applied, const double *temperatures,
                     const double *conditions, double *scale) {
    int status = 0;
    if (TURN(m) == 2) adopt(m);
    while (m->stage < LPTN_N - 1 && m->age >= m->ends[m->stage]) m->stage++;
    const int over = m->age >= m->ends[LPTN_N - 1];
    for (int j = 0; j < LPTN_NU; j++) {
        const double request = number(asked[j]) ? fabs(asked[j]) : NAN;
        m->scale[j] = m->plan[m->stage][j];
        if (over) m->scale[j] = request > 0 ? fmin(m->floor[j] / request, 1) : 0;
        scale[j] = m->scale[j];
        double done = request * m->scale[j];
        if (applied && is_alive(m, j, applied[j], done)) done = fabs(applied[j]);
        else if (applied) status |= LPTN_LOOP_BLIND;
        if (request >= 0) m->asked[j] += request * request, m->asked_count[j]++;
        if (done >= 0) m->done[j] += done * done, m->done_count[j]++;
    }
    for (int i = 0; i < LPTN_NN; i++)
        if (number(temperatures[i])) m->temperature[i] = temperatures[i];
    for (int i = 0; i < LPTN_ND; i++) {
        const double value = conditions[i];
        if (!number(value)) continue;
        m->around[i] += lptn_condition_kind[i] == LPTN_RMS        ? value * value
                        : lptn_condition_kind[i] == LPTN_ABSOLUTE ? fabs(value)
                                                                  : value;
        m->condition_count[i]++;
    }
    /* The first reading is handed over at once, the others after a period each. */
    const int first = !m->begun;
    m->begun = 1, m->count++;
    if (m->age < m->ends[LPTN_N - 1]) m->age++;
    if (TURN(m) == 0 && (first || m->count >= m->ticks)) hand_over(m);
    if (TURN(m) == 1) status |= LPTN_LOOP_WAITING;
    if (m->age > LATE * m->ticks) status |= LPTN_LOOP_LATE;
    return over ? status | LPTN_LOOP_OVER : status;
}

static double weight(const lptn_mpc_settings *o, int j, double request) {
    return number(request) ? o->weight[j] * request * request : 0;
}

/* What is known of a coming stage, else what the last period measured. */
static double foreseen(const double *ahead, int entry, double measured) {
    return ahead && !isnan(ahead[entry]) ? ahead[entry] : measured;
}

int lptn_loop_think(const lptn_mpc_settings *o, lptn_loop *m, lptn_mpc_state *state, lptn_mpc_work *work,
                    const double *requests, const double *conditions, lptn_mpc_result *out) {
    double asked[LPTN_N * LPTN_NU], around[LPTN_N * LPTN_ND + 1];
    if (TURN(m) != 1) return 0;
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) asked[k * LPTN_NU + j] = foreseen(requests, k * LPTN_NU + j, m->mean_asked[j]);
        for (int i = 0; i < LPTN_ND; i++) around[k * LPTN_ND + i] = foreseen(conditions, k * LPTN_ND + i, m->mean_around[i]);
    }
    lptn_mpc_step(o, state, work, m->reading, asked, around, m->mean_done, out);
    for (int k = 0; k < LPTN_N; k++) {
        double all = 0;
        for (int j = 0; j < LPTN_NU; j++) all += weight(o, j, asked[k * LPTN_NU + j]);
        for (int j = 0; j < LPTN_NU; j++) {
            const int counts = weight(o, j, asked[k * LPTN_NU + j]) > TRIFLE * all;
            m->next[k][j] = counts ? sqrt(state->scale[k][j]) : 1;
        }
    }
    PASS(m, 2);
    return 1;
}

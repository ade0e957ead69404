/* One step of the thermal controller: sensors, estimate, exact linear steps, interior point with Riccati elimination. */
#include "lptn_mpc.h"

#include <math.h>
#include <string.h>

#include "conditions.h" /* what each condition is: LPTN_TEMPERATURE, ... */
#include "pattern.h"
#include "heat.inc"
#include "linear.inc"
#include "living.inc"
#include "filter.inc"
#include "observe.inc"
#include "bounds.inc"
#include "newton.inc"
#include "interior.inc"

#define ANOTHER 0.2 /* of all requests: where they change by so much, another thing is asked, and shares may jump */
#define KEPT 1e-3 /* K, or of the power limit; slack below it is the solver's own */

/* Requests and conditions as finite numbers, and what a deviation from them costs. */
static void take(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, const double *request,
                 const double *conditions, lptn_mpc_result *out) {
    double all = 0;
    for (int k = 0; k < LPTN_N; k++) {
        for (int i = 0; i < LPTN_ND; i++) {
            const double given = conditions[k * LPTN_ND + i];
            const int good = lptn_condition_kind[i] == LPTN_TEMPERATURE ? believed(given) : isfinite(given);
            if (good) m->conditions[i] = given;
            else out->status |= LPTN_NO_CONDITION;
            m->known[i] |= good && k == 0;
            w->d[k][i] = m->conditions[i];
        }
        for (int j = 0; j < LPTN_NU; j++) {
            const double given = request[k * LPTN_NU + j];
            if (!isfinite(given)) out->status |= LPTN_NO_REQUEST;
            w->c[k][j] = isfinite(given) ? given : 0.0;
            w->a[k][j] = o->stage[k] * o->weight[j] * w->c[k][j] * w->c[k][j];
            all += w->a[k][j];
        }
    }
    memcpy(m->conditions, w->d[0], sizeof w->d[0]);
    /* A joint of which nothing is asked keeps a trace of cost, so that its scale is determined. */
    for (int k = 0; k < LPTN_N; k++)
        for (int j = 0; j < LPTN_NU; j++)
            w->a[k][j] = all > 0 ? fmax(w->a[k][j] / all, 1e-9) : 1.0 / (LPTN_N * LPTN_NU);
}

/* A joint's share of its request falls at once and rises with the time constant `smoothing`, as far as the same is asked as
 * in the period before. Less than was planned is cooler than was planned: no limit is passed for the sake of quiet. */
static void rise_slowly(const lptn_mpc_settings *o, const lptn_mpc_state *m, lptn_mpc_work *w) {
    if (!(o->smoothing > 0)) return;
    double changed = 0, before = 0;
    for (int j = 0; j < LPTN_NU; j++) {
        changed += (w->c[0][j] - m->asked[j]) * (w->c[0][j] - m->asked[j]);
        before += m->asked[j] * m->asked[j];
    }
    const double same = before > 0 ? fmax(1 - changed / before / (ANOTHER * ANOTHER), 0) : 0;
    for (int j = 0; j < LPTN_NU; j++) {
        const double share = sqrt(w->s[0][j]), rise = share - m->share[j];
        const double kept = rise > 0 ? share - same * exp(-o->stage[0] / o->smoothing) * rise : share;
        w->s[0][j] = fmax(kept * kept, w->lo[0][j]);
    }
}

/* Whether everything that the current allows stays below every limit; then it is the optimum. */
static int all_stays_cool(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    memcpy(w->s, w->hi, sizeof w->s);
    for (int k = 0; k < LPTN_N; k++) {
        linearise(o, w, k, w->x[k]);
        advance(&w->stage[k], w->x[k], w->s[k], w->x[k + 1]);
        for (int l = 0; l < LPTN_NR; l++)
            if (!(bounded(o, w, k, l) <= w->limit[k][l])) return 0;
    }
    return 1;
}

/* The course under the scales in w->s, rolled out. */
static void roll_out(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    memcpy(w->x[0], w->start, sizeof w->start);
    for (int k = 0; k < LPTN_N; k++) {
        linearise(o, w, k, w->x[k]);
        advance(&w->stage[k], w->x[k], w->s[k], w->x[k + 1]);
    }
}

static void report(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, lptn_mpc_result *out) {
    out->cost = out->worst = 0;
    for (int k = 0; k < LPTN_N; k++) {
        linearise_power(o, w, k, w->x[k]);
        out->power[k] = LPTN_NR > LPTN_NL ? o->power * bounded(o, w, k, LPTN_NL) : NAN;
        if (out->power[k] > (1 + KEPT) * o->power) out->status |= LPTN_OVER_POWER;
        for (int j = 0; j < LPTN_NU; j++) {
            const double scale = sqrt(w->s[k][j]);
            out->plan[k][j] = scale * w->c[k][j];
            out->cost += w->a[k][j] * (1 - scale) * (1 - scale);
        }
        for (int l = 0; l < LPTN_NL; l++) {
            const int owner = o->owner[o->node[l]], lost = m->sensors.lost[owner];
            const double bound = lost ? w->limit[k][l] : o->limit[l] - out->margin[l]; /* to which it comes in its time */
            out->slack[k][l] = fmax(w->x[k + 1][o->node[l]] - bound, 0.0);
            out->worst = fmax(out->worst, out->slack[k][l]);
        }
    }
    if (out->worst > KEPT) out->status |= LPTN_TOO_HOT;
    memcpy(out->x, w->x, sizeof out->x);
    memcpy(out->admitted, out->plan[0], sizeof out->admitted);
    memcpy(m->applied, out->admitted, sizeof m->applied);
    memcpy(m->scale, w->s, sizeof m->scale);
    for (int j = 0; j < LPTN_NU; j++) m->asked[j] = w->c[0][j], m->share[j] = sqrt(w->s[0][j]);
}

void lptn_mpc_step(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, const double *measured,
                   const double *request, const double *conditions, const double *applied, lptn_mpc_result *out) {
    memset(out, 0, sizeof *out);
    memcpy(w->p, o->p, sizeof w->p);
    if (m->started) predict(o, m, w, applied), doubt_changes(o, m, conditions);
    take(o, m, w, request, conditions, out);
    observe(o, m, measured, out);
    plan_from(o, m, w, out);
    for (int k = 0; k <= LPTN_N; k++) memcpy(w->x[k], w->start, sizeof w->start);
    limit(o, m, w, out);
    bound(o, m, w, 1, out);
    double start[LPTN_N][LPTN_NU];
    memcpy(start, w->s, sizeof start);
    if (all_stays_cool(o, w)) {
        out->status |= LPTN_SHORTCUT;
    } else {
        memcpy(w->s, start, sizeof start);
        if (!solve(o, m, w, out)) {
            out->status |= LPTN_NOT_BEST;
            roll_out(o, w);
        }
    }
    rise_slowly(o, m, w);
    report(o, m, w, out);
}

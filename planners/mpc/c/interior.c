/* Primal-dual interior point for the heat scales: convex cost, linear steps, soft limits; the dynamics are linearised
 * anew on the way down. One factorisation serves a predictor and a corrector (Mehrotra 1992).
 *
 * Mehrotra's corrector takes the predictor's second-order error as if the whole predictor could be gone; where only a
 * thirtieth of it can, that correction is thirty times too large and the iterates can go round in circles for ever. It is
 * therefore taken for the share that can be gone (Colombo and Gondzio 2008). */

#define BOUNDARY 0.995 /* share of the way to the nearest bound */
#define FIRST 1e-3     /* duality gap at which the dynamics are linearised for the second time */
#define REPEAT 4       /* iterations between linearisations */
#define LEAST 1e-2     /* share of mu that a step aims at, at least */
#define SHORT 0.3      /* steps below it are tried again without correction */
#define HALVINGS 6     /* of a stage's scales, in the first guess */
#define AGREED 1e-4    /* K; stages that miss each other by so little are joined */

/* Start from the scales in w->s, all constraints strictly inside. */
static void begin(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    const double mu = 0.1 / (LPTN_N * LPTN_NU);
    memset(w->ds, 0, sizeof w->ds), memset(w->dl, 0, sizeof w->dl), memset(w->du, 0, sizeof w->du);
    memset(w->dt, 0, sizeof w->dt), memset(w->dy, 0, sizeof w->dy);
    memset(w->de, 0, sizeof w->de), memset(w->dz, 0, sizeof w->dz);
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            w->zl[k][j] = mu / (w->s[k][j] - w->lo[k][j]);
            w->zu[k][j] = mu / (w->hi[k][j] - w->s[k][j]);
        }
        for (int l = 0; l < LPTN_NL; l++) {
            const double over = w->x[k + 1][o->node[l]] - w->limit[k][l];
            w->e[k][l] = fmax(over, 0) + 10 * mu / o->linear + 1e-3;
            w->t[k][l] = fmax(w->e[k][l] - over, 1e-2);
            w->y[k][l] = fmin(mu / w->t[k][l], 0.5 * o->linear);
            w->z[k][l] = o->linear + o->quadratic * w->e[k][l] - w->y[k][l];
        }
    }
}

/* A first trajectory: each stage's scales are halved until its end is no hotter than the limits, or its beginning. About a
 * thermal runaway there is nothing to be learnt. */
static void guess(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w) {
    memcpy(w->x[0], m->x, sizeof m->x);
    for (int k = 0; k < LPTN_N; k++) {
        for (int tries = 0; tries < HALVINGS; tries++) {
            int hot = 0;
            if (tries)
                for (int j = 0; j < LPTN_NU; j++)
                    w->s[k][j] = fmax(0.5 * w->s[k][j], w->lo[k][j] + INSIDE * (w->hi[k][j] - w->lo[k][j]));
            linearise(o, w, k, w->x[k]);
            advance(&w->stage[k], w->x[k], w->s[k], w->x[k + 1]);
            for (int l = 0; l < LPTN_NL; l++)
                hot |= w->x[k + 1][o->node[l]] > fmax(w->limit[k][l], w->x[k][o->node[l]]);
            if (!hot) break;
        }
    }
}

/* Linearise each stage about the middle of its present course; returns by how much its end then misses the next stage's
 * start [K]. The stages are joined by the Newton steps, not by a roll-out (multiple shooting): a hot winding's heat grows
 * with its temperature, and an error at the first stage would by the last one have grown without bound. */
static double renew(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    double missed = 0, at[LPTN_NX], end[LPTN_NX];
    for (int k = 0; k < LPTN_N; k++) {
        for (int i = 0; i < LPTN_NX; i++) at[i] = 0.5 * (w->x[k][i] + w->x[k + 1][i]);
        linearise(o, w, k, at);
        advance(&w->stage[k], w->x[k], w->s[k], end);
        for (int i = 0; i < LPTN_NX; i++) {
            w->gap[k][i] = end[i] - w->x[k + 1][i];
            missed = fmax(missed, fabs(w->gap[k][i]));
        }
    }
    return missed;
}

/* Mean complementarity if a step of this length is taken. */
static double complementarity(const lptn_mpc_work *w, double step) {
    double sum = 0;
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            const double s = w->s[k][j] + step * w->ds[k][j];
            sum += (s - w->lo[k][j]) * (w->zl[k][j] + step * w->dl[k][j]);
            sum += (w->hi[k][j] - s) * (w->zu[k][j] + step * w->du[k][j]);
        }
        for (int l = 0; l < LPTN_NL; l++) {
            sum += (w->t[k][l] + step * w->dt[k][l]) * (w->y[k][l] + step * w->dy[k][l]);
            sum += (w->e[k][l] + step * w->de[k][l]) * (w->z[k][l] + step * w->dz[k][l]);
        }
    }
    return sum / (2 * LPTN_N * (LPTN_NU + LPTN_NL));
}

static inline double reach(double value, double change) { return change < 0 ? -value / change : 1e30; }

/* How far the step may go before something turns negative. */
static double longest(const lptn_mpc_work *w) {
    double most = 1e30;
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            most = fmin(most, reach(w->s[k][j] - w->lo[k][j], w->ds[k][j]));
            most = fmin(most, reach(w->hi[k][j] - w->s[k][j], -w->ds[k][j]));
            most = fmin(most, fmin(reach(w->zl[k][j], w->dl[k][j]), reach(w->zu[k][j], w->du[k][j])));
        }
        for (int l = 0; l < LPTN_NL; l++) {
            most = fmin(most, fmin(reach(w->t[k][l], w->dt[k][l]), reach(w->y[k][l], w->dy[k][l])));
            most = fmin(most, fmin(reach(w->e[k][l], w->de[k][l]), reach(w->z[k][l], w->dz[k][l])));
        }
    }
    return most;
}

static void correct(lptn_mpc_work *w, double share) {
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            w->cl[k][j] = share * w->ds[k][j] * w->dl[k][j];
            w->cu[k][j] = -share * w->ds[k][j] * w->du[k][j];
        }
        for (int l = 0; l < LPTN_NL; l++) {
            w->ct[k][l] = share * w->dt[k][l] * w->dy[k][l];
            w->ce[k][l] = share * w->de[k][l] * w->dz[k][l];
        }
    }
}

static void forget_corrections(lptn_mpc_work *w) {
    memset(w->cl, 0, sizeof w->cl), memset(w->cu, 0, sizeof w->cu);
    memset(w->ct, 0, sizeof w->ct), memset(w->ce, 0, sizeof w->ce);
}

static void move(lptn_mpc_work *w, double step) {
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            w->s[k][j] += step * w->ds[k][j];
            w->zl[k][j] += step * w->dl[k][j];
            w->zu[k][j] += step * w->du[k][j];
        }
        for (int l = 0; l < LPTN_NL; l++) {
            w->t[k][l] += step * w->dt[k][l];
            w->y[k][l] += step * w->dy[k][l];
            w->e[k][l] += step * w->de[k][l];
            w->z[k][l] += step * w->dz[k][l];
        }
        for (int i = 0; i < LPTN_NX; i++) {
            w->x[k + 1][i] += step * w->dx[k + 1][i];
            w->gap[k][i] *= 1 - step;
        }
    }
}

static int is_sound(const lptn_mpc_work *w) {
    double sum = 0;
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) sum += w->ds[k][j] + w->dl[k][j] + w->du[k][j];
        for (int l = 0; l < LPTN_NL; l++) sum += w->dy[k][l] + w->dz[k][l];
    }
    return isfinite(sum);
}

/* Keep the scales if none so far were better: cost, and the price of passing limits or of stages that miss each other. */
static void keep_best(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    double price = 0;
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) price += w->a[k][j] * (w->s[k][j] - 2 * sqrt(w->s[k][j]));
        for (int l = 0; l < LPTN_NL; l++) {
            const int i = o->node[l];
            const double over = fmax(w->x[k + 1][i] + fabs(w->gap[k][i]) - w->limit[k][l], 0);
            price += o->linear * over + 0.5 * o->quadratic * over * over;
        }
    }
    if (!(price < w->least)) return;
    w->least = price;
    memcpy(w->best, w->s, sizeof w->best);
}

/* One attempt from the scales in w->s, ended after `most` iterations in all; whether they became the optimum. A careful one
 * aims every step at the central path and corrects nothing: half as fast, and nothing can send it round in circles. */
static int attempt(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, int careful, int most,
                   lptn_mpc_result *out) {
    const double pairs = 2.0 * LPTN_N * (LPTN_NU + LPTN_NL);
    int since = 0, linearised = 2;
    double full = 0;
    guess(o, m, w);
    bound(o, m, w, 0, out);
    out->error = renew(o, w);
    begin(o, w);
    for (; out->iterations < most; out->iterations++) {
        const double mu = complementarity(w, 0);
        out->gap = mu * pairs;
        if (since >= REPEAT || (out->gap < FIRST && linearised < 3) || (out->gap < o->tolerance && since)) {
            out->error = renew(o, w);
            linearised++;
            since = 0;
        }
        keep_best(o, w);
        if (out->gap < o->tolerance && out->error < AGREED && full > 0.9) break;
        curvatures(o, w);
        if (!factorise(o, w)) break;
        forget_corrections(w);
        direction(o, w, careful ? 0.3 * mu : 0);
        if (!careful) {
            const double trial = fmin(1, longest(w)), ratio = complementarity(w, trial) / mu;
            correct(w, trial);
            direction(o, w, fmax(mu * fmax(ratio * ratio * ratio, LEAST), 0.1 * o->tolerance / pairs));
        }
        full = fmin(1, BOUNDARY * longest(w));
        if (full < SHORT) {
            /* Too near a corner for a second-order step: back to the middle first. */
            forget_corrections(w);
            direction(o, w, 0.5 * mu);
            full = fmin(1, BOUNDARY * longest(w));
        }
        if (!is_sound(w)) break;
        move(w, full);
        since++;
    }
    out->linearisations += linearised;
    return out->gap < o->tolerance && out->error < AGREED && full > 0.9;
}

/* Whether the scales in w->s became the optimum; else they are the best that were met. A second attempt knows nothing
 * of the last plan. */
static int solve(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, lptn_mpc_result *out) {
    w->least = 1e300;
    memcpy(w->best, w->s, sizeof w->best);
    if (attempt(o, m, w, 0, o->warm < o->iterations ? o->warm : o->iterations, out)) return 1;
    for (int k = 0; k < LPTN_N; k++)
        for (int j = 0; j < LPTN_NU; j++) w->s[k][j] = 0.5 * (w->lo[k][j] + w->hi[k][j]);
    if (attempt(o, m, w, 1, o->iterations, out)) return 1;
    memcpy(w->s, w->best, sizeof w->s);
    return 0;
}

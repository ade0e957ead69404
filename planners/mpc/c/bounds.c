/* Bounds of the heat scales: current limit at the expected temperatures, rate limit of the first stage; and of the
 * temperatures at the ends of the stages. */

#define INSIDE 0.02   /* of the way from one bound to the other, where the solver starts at most */
#define FALLS 120.0   /* s, time constants with which noise near a limit is followed: long beside a reading's weight in the */
#define RISES 240.0   /* estimate, below the horizon; longer from below, else nodes would dwell at the noise's hot end */
#define NEARLY 0.9999 /* of the upper bound, where a floor may lie at most: the solver needs an inside */

static void bound(const lptn_mpc_settings *o, const lptn_mpc_state *m, lptn_mpc_work *w, int first,
                  lptn_mpc_result *out) {
    for (int k = 0; k < LPTN_N; k++) {
        const double *gain = gain_at(o, w, w->x[k], w->d[k]);
        for (int j = 0; j < LPTN_NU; j++) {
            const double c = fabs(w->c[k][j]), current = c * gain[j];
            double hi = 1.0, lo;
            if (current > o->most[j]) {
                hi = o->most[j] / current * (o->most[j] / current);
                out->status |= LPTN_CURRENT_CUT;
            }
            lo = FLOOR * hi;
            if (k == 0 && o->rate[j] > 0 && c > 0) {
                const double change = o->rate[j] * o->stage[0], before = fabs(m->applied[j]);
                const double up = (before + change) / c, down = fmax(before - change, 0.0) / c;
                hi = fmin(hi, fmax(up * up, 1e-6));
                lo = fmax(FLOOR * hi, fmin(down * down, 0.98 * hi));
            }
            if (o->floor[j] > 0 && c > 0) lo = fmax(lo, fmin(o->floor[j] / c * (o->floor[j] / c), NEARLY * hi));
            w->lo[k][j] = lo, w->hi[k][j] = hi;
            if (first) {
                const double *kept = m->scale[k + 1 < LPTN_N ? k + 1 : k];
                w->s[k][j] = kept[j] > 0 ? kept[j] : 0.5 * hi;
            }
            w->s[k][j] = fmin(fmax(w->s[k][j], lo + INSIDE * (hi - lo)), hi - INSIDE * (hi - lo));
        }
    }
}

/* What a node is above its limit falls by dT/dt = -(T - limit)/recovery, at each step the same course.
 *
 * Near its limit less the margin, where most of the difference is the readings' noise, a node comes to it from above or
 * below in some minutes: brought there within one period, all noise would become torque. From above as far as the limit;
 * from below as far as noise may reach, from twice as far it warms as fast as it likes. */
static void limit(const lptn_mpc_settings *o, const lptn_mpc_state *m, lptn_mpc_work *w, lptn_mpc_result *out) {
    double time = 0;
    for (int l = 0; l < LPTN_NL; l++) out->margin[l] = margin_of(o, m, o->owner[o->node[l]]);
    for (int k = 0; k < LPTN_N; k++) {
        time += o->stage[k];
        for (int l = 0; l < LPTN_NL; l++) {
            const double slow = o->recovery[l], margin = out->margin[l], noise = noise_of(m, o->owner[o->node[l]]);
            const double over = m->x[o->node[l]] - o->limit[l], below = -(over + margin);
            const double eased = below > 0 ? -fmin(below, fmax(2 * noise - below, 0)) : fmin(-below, margin);
            const double eases = below > 0 ? RISES : FALLS;
            double left = 0;
            if (slow > 0) left = exp(-time / slow) * fmax(over, 0.0) + exp(-time / fmin(slow, eases)) * eased;
            w->limit[k][l] = o->limit[l] - margin + left;
        }
    }
}

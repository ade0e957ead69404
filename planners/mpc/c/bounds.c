/* Bounds of the heat scales: current limit at the expected temperatures, rate limit of the first stage; and of the
 * temperatures at the ends of the stages. */

#define INSIDE 0.02 /* of the way from one bound to the other, where the solver starts at most */

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
            w->lo[k][j] = lo, w->hi[k][j] = hi;
            if (first) {
                const double *kept = m->scale[k + 1 < LPTN_N ? k + 1 : k];
                w->s[k][j] = kept[j] > 0 ? kept[j] : 0.5 * hi;
            }
            w->s[k][j] = fmin(fmax(w->s[k][j], lo + INSIDE * (hi - lo)), hi - INSIDE * (hi - lo));
        }
    }
}

/* A node that begins above its limit may take the time of recovery to come down to it, in a straight line. */
static void limit(const lptn_mpc_settings *o, const lptn_mpc_state *m, lptn_mpc_work *w) {
    double time = 0;
    for (int k = 0; k < LPTN_N; k++) {
        time += o->stage[k];
        const double left = o->recovery > 0 ? fmax(0.0, 1 - time / o->recovery) : 0.0;
        for (int l = 0; l < LPTN_NL; l++)
            w->limit[k][l] = o->limit[l] + left * fmax(0.0, m->x[o->node[l]] - o->limit[l]);
    }
}

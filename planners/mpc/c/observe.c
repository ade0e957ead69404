/* What the model lacks, found from its own predictions: for each node a small Kalman filter of temperature, missing heat
 * and relative error of the controlled heat. The error of a parameter shows as both: without the second, the bias
 * would lag whenever the load changes. */

#define HOTTEST 500.0     /* degC; beyond these no reading is believed */
#define COLDEST -80.0
#define STEADY 0.2        /* of the reading's noise: what the prediction of one period may miss beside bias and gain */
#define BIAS_HOLDS 1800.0 /* s in which the bias may walk as far as it was doubted at first */
#define GAIN_HOLDS 3600.0
#define MOST_GAIN 0.8
#define GUESSED 10.0 /* K; error of a temperature that nobody has read */
#define LOST 10.0    /* standard deviations, or K, of a reading from its prediction */

static double hottest_limit(const lptn_mpc_settings *o) {
    double hottest = o->limit[0];
    for (int l = 1; l < LPTN_NL; l++) hottest = fmax(hottest, o->limit[l]);
    return hottest;
}

static int believed(double reading) { return reading > COLDEST && reading < HOTTEST; }

/* What is known of a node when its filter starts; a temperature that was only guessed is given up once it is read. */
static void begin_node(const lptn_mpc_settings *o, lptn_mpc_state *m, int i, int read) {
    memset(m->spread[i], 0, sizeof m->spread[i]);
    m->spread[i][0][0] = read ? o->noise * o->noise : GUESSED * GUESSED;
    m->spread[i][1][1] = o->doubt[i] * o->doubt[i];
    m->spread[i][2][2] = o->gain_doubt[i] * o->gain_doubt[i];
    m->bias[i] = m->gain[i] = 0;
    m->guessed[i] = !read;
}

static void begin_estimate(const lptn_mpc_settings *o, lptn_mpc_state *m, const double *measured) {
    double hottest = COLDEST;
    for (int i = 0; i < LPTN_NN; i++)
        if (believed(measured[i])) hottest = fmax(hottest, measured[i]);
    /* A node nobody has read yet is taken to be as hot as the hottest; if none is read, as hot as allowed. */
    if (hottest <= COLDEST) hottest = hottest_limit(o);
    for (int i = 0; i < LPTN_NX; i++) m->x[i] = believed(measured[o->owner[i]]) ? measured[o->owner[i]] : hottest;
    for (int i = 0; i < LPTN_NN; i++) begin_node(o, m, i, believed(measured[i]));
    m->started = 1;
}

/* The estimate one control period on, under what was applied. */
static void predict(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w) {
    const double h = o->stage[0];
    double ones[LPTN_NU], heat[LPTN_NU], *made = m->made, *rates, *slope, *controlled, *unused;
    for (int j = 0; j < LPTN_NU; j++) ones[j] = 1, heat[j] = m->applied[j] * m->applied[j];
    memcpy(w->bias, m->bias, sizeof w->bias), memcpy(w->gain, m->gain, sizeof w->gain);
    evaluate(o, w, m->x, heat, m->conditions, &rates, &slope, &controlled, &unused);
    for (int i = 0; i < LPTN_NN; i++) {
        made[i] = 0;
        for (int j = 0; j < LPTN_NU; j++) made[i] += controlled[i * LPTN_NU + j] * heat[j];
    }
    stage_matrices(o, w, h, m->x, ones, m->applied, m->conditions, w->M[0], w->offset[0]);
    advance(w, 0, m->x, ones, m->x);
    for (int i = 0; i < LPTN_NN; i++) {
        /* Rows of the transition: temperature from temperature, bias and gain; the other two stay. */
        double(*P)[3] = m->spread[i], moved[3];
        const double row[3] = {w->M[0][i][LPTN_NU + i], h, h * made[i]};
        for (int a = 0; a < 3; a++) moved[a] = row[0] * P[0][a] + row[1] * P[1][a] + row[2] * P[2][a];
        const double own = row[0] * moved[0] + row[1] * moved[1] + row[2] * moved[2];
        P[0][1] = P[1][0] = moved[1], P[0][2] = P[2][0] = moved[2];
        P[0][0] = own + STEADY * STEADY * o->noise * o->noise;
        P[1][1] += o->doubt[i] * o->doubt[i] * h / BIAS_HOLDS;
        P[2][2] += o->gain_doubt[i] * o->gain_doubt[i] * h / GAIN_HOLDS;
    }
}

static void correct_node(const lptn_mpc_settings *o, lptn_mpc_state *m, int i, double reading) {
    double(*P)[3] = m->spread[i], gain[3], top[3];
    m->guessed[i] = 0;
    const double innovation = reading - m->x[i], whole = P[0][0] + o->noise * o->noise;
    if (!(o->doubt[i] > 0) || !(whole > 0)) {
        m->x[i] = reading;
        return;
    }
    if (!(innovation * innovation < LOST * LOST * whole + LOST * LOST)) {
        /* So far from the prediction nothing that was learnt can be right. */
        m->x[i] = reading;
        begin_node(o, m, i, 1);
        return;
    }
    for (int a = 0; a < 3; a++) gain[a] = P[a][0] / whole, top[a] = P[0][a];
    m->x[i] += gain[0] * innovation;
    m->bias[i] += gain[1] * innovation;
    m->gain[i] = fmax(-MOST_GAIN, fmin(m->gain[i] + gain[2] * innovation, MOST_GAIN));
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) P[a][b] -= gain[a] * top[b];
}

/* What is kept below a limit for what is not known: so many standard deviations of the node's temperature one period on, by
 * the filter's covariance. Later stages need no more: by then there will have been a reading. */
static double margin_of(const lptn_mpc_settings *o, const lptn_mpc_state *m, int i) {
    const double h = o->stage[0], row[3] = {1, h, h * m->made[i]};
    double variance = o->grain * o->grain + STEADY * STEADY * o->noise * o->noise;
    if (i >= LPTN_NN) return 0;
    if (m->guessed[i] || !(o->doubt[i] > 0)) {
        /* A guess is on the safe side as it is; readings taken as they are have their own noise. */
        variance = o->noise * o->noise;
    } else {
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) variance += row[a] * m->spread[i][a][b] * row[b];
    }
    return o->sigmas * fmin(sqrt(fmax(variance, 0)), GUESSED);
}

/* Readings into the estimate; what was applied has moved it on by one period. */
static void observe(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, const double *measured,
                    const double *applied, lptn_mpc_result *out) {
    for (int i = 0; i < LPTN_NN; i++)
        if (!believed(measured[i])) out->status |= LPTN_UNMEASURED;
    if (!m->started) {
        begin_estimate(o, m, measured);
        return;
    }
    for (int j = 0; j < LPTN_NU; j++)
        if (applied && isfinite(applied[j])) m->applied[j] = applied[j];
    predict(o, m, w);
    for (int i = 0; i < LPTN_NN; i++)
        if (believed(measured[i])) correct_node(o, m, i, measured[i]);
    for (int i = 0; i < LPTN_NX; i++)
        if (!believed(m->x[i])) m->x[i] = believed(m->x[o->owner[i]]) ? m->x[o->owner[i]] : hottest_limit(o);
}

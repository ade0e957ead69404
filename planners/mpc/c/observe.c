/* What the model lacks, found from its own predictions: for each node a small Kalman filter of temperature, missing heat
 * and relative error of the controlled heat. The error of a parameter shows as both: without the second, the bias
 * would lag whenever the load changes. Sensors that aren't alive are left out, as missing ones are.
 *
 * That a sensor stands is only seen after a while. Beside each filter goes one that was given none of the readings like the
 * last: it takes over when the sensor is found to stand, as if those readings had never come. */

#define STEADY 0.2        /* of the reading's noise: what the prediction of one period may miss beside bias and gain */
#define BIAS_HOLDS 1800.0 /* s in which the bias may walk as far as it was doubted at first */
#define GAIN_HOLDS 3600.0
#define MOST_GAIN 0.8
#define NOISY 3.0    /* standard deviations of an estimate, beyond which a difference is no noise */
#define GUESSED 10.0 /* K; error of a temperature that nobody has read */

#define SQRT_12 3.46410161513775458705

static double hottest_limit(const lptn_mpc_settings *o) {
    double hottest = o->limit[0];
    for (int l = 1; l < LPTN_NL; l++) hottest = fmax(hottest, o->limit[l]);
    return hottest;
}

/* What is known of a node when its filter starts; a temperature that was only guessed is given up once it is read. */
static void begin_node(const lptn_mpc_settings *o, lptn_mpc_state *m, int i, int read) {
    memset(m->spread[i], 0, sizeof m->spread[i]);
    m->spread[i][0][0] = read ? o->noise * o->noise : GUESSED * GUESSED;
    m->spread[i][1][1] = o->doubt[i] * o->doubt[i];
    m->spread[i][2][2] = o->gain_doubt[i] * o->gain_doubt[i];
    m->bias[i] = m->gain[i] = 0;
    m->guessed[i] = !read;
}

/* Start the filter that knows none of the readings like the last one where the node's own is now. */
static void fork_node(lptn_mpc_state *m, int i) {
    lptn_mpc_fork *fork = &m->fork[i];
    fork->x = m->x[i], fork->bias = m->bias[i], fork->gain = m->gain[i];
    memcpy(fork->spread, m->spread[i], sizeof fork->spread);
}

/* The sensor stands: what was taken from it since is taken back. */
static void take_back(const lptn_mpc_settings *o, lptn_mpc_state *m, int i) {
    const lptn_mpc_fork *fork = &m->fork[i];
    if (!isfinite(m->sensors.grain[i])) {
        /* It has never moved: no reading of it was one. */
        for (int l = 0; l < LPTN_NN; l++)
            if (l != i && !m->guessed[l] && !m->sensors.silent[l]) m->x[i] = fmax(m->x[i], m->x[l]);
        begin_node(o, m, i, 0);
        return;
    }
    m->x[i] = fork->x, m->bias[i] = fork->bias, m->gain[i] = fork->gain;
    memcpy(m->spread[i], fork->spread, sizeof fork->spread);
}

static void begin_estimate(const lptn_mpc_settings *o, lptn_mpc_state *m, const double *measured) {
    double hottest = COLDEST;
    for (int i = 0; i < LPTN_NN; i++)
        if (believed(measured[i])) hottest = fmax(hottest, measured[i]);
    /* A node nobody has read yet is taken to be as hot as the hottest; if none is read, as hot as allowed. */
    if (hottest <= COLDEST) hottest = hottest_limit(o);
    for (int i = 0; i < LPTN_NX; i++) m->x[i] = believed(measured[o->owner[i]]) ? measured[o->owner[i]] : hottest;
    for (int i = 0; i < LPTN_NN; i++) begin_node(o, m, i, believed(measured[i]));
    begin_sensors(&m->sensors);
    m->started = 1;
}

/* A node's covariance one control period on. */
static void widen(const lptn_mpc_settings *o, int i, const double *row, double P[3][3]) {
    const double h = o->stage[0];
    double moved[3];
    for (int a = 0; a < 3; a++) moved[a] = row[0] * P[0][a] + row[1] * P[1][a] + row[2] * P[2][a];
    const double own = row[0] * moved[0] + row[1] * moved[1] + row[2] * moved[2];
    P[0][1] = P[1][0] = moved[1], P[0][2] = P[2][0] = moved[2];
    P[0][0] = own + STEADY * STEADY * o->noise * o->noise;
    P[1][1] += o->doubt[i] * o->doubt[i] * h / BIAS_HOLDS;
    P[2][2] += o->gain_doubt[i] * o->gain_doubt[i] * h / GAIN_HOLDS;
}

/* The estimate one control period on, under what was applied. */
static void predict(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w) {
    const double h = o->stage[0];
    double ones[LPTN_NU], heat[LPTN_NU], *made = m->made, *rates, *slope, *controlled, *unused;
    for (int j = 0; j < LPTN_NU; j++) ones[j] = 1, heat[j] = m->applied[j] * m->applied[j];
    memcpy(w->bias, m->bias, sizeof w->bias), memcpy(w->gain, m->gain, sizeof w->gain);
    evaluate(o, w, m->x, heat, m->conditions, &rates, &slope, &controlled, &unused);
    memset(made, 0, sizeof m->made);
    for (int n = 0; n < LPTN_NB; n++)
        if (heated_row[n] < LPTN_NN) made[heated_row[n]] += controlled[n] * heat[heated_column[n]];
    double before[LPTN_NN];
    memcpy(before, m->x, sizeof before);
    lptn_mpc_stage *stage = &w->stage[0];
    make_stage(o, w, h, m->x, ones, m->applied, m->conditions, stage);
    advance(stage, m->x, ones, m->x);
    double stays[LPTN_NX]; /* of a node's own temperature, after one period: the diagonal of I + F A */
    for (int i = 0; i < LPTN_NX; i++) stays[i] = 1;
    for (int n = 0; n < LPTN_NA; n++) stays[slope_column[n]] += stage->F[slope_column[n]][slope_row[n]] * stage->A[n];
    for (int i = 0; i < LPTN_NN; i++) {
        /* Row of the transition: temperature from temperature, bias and gain; the other two stay. */
        const double row[3] = {stays[i], h, h * made[i]};
        lptn_mpc_fork *fork = &m->fork[i];
        fork->x = m->x[i] + row[0] * (fork->x - before[i]) + row[1] * (fork->bias - m->bias[i]) +
                  row[2] * (fork->gain - m->gain[i]);
        widen(o, i, row, m->spread[i]);
        widen(o, i, row, fork->spread);
    }
    m->sensors.clock += h;
}

/* anew: the reading is so far from the prediction that nothing that was learnt can be right. */
static void correct_node(const lptn_mpc_settings *o, lptn_mpc_state *m, int i, double reading, int anew) {
    double(*P)[3] = m->spread[i], gain[3], top[3];
    const double innovation = reading - m->x[i], whole = P[0][0] + o->noise * o->noise;
    m->guessed[i] = 0;
    if (!(o->doubt[i] > 0) || !(whole > 0)) {
        m->x[i] = reading;
        return;
    }
    if (anew) {
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

/* What the estimate of a node may be off now [K], by what it was read with. */
static double noise_of(const lptn_mpc_state *m, int i) {
    return i < LPTN_NN && !m->guessed[i] ? NOISY * sqrt(fmax(m->spread[i][0][0], 0)) : 0;
}

/* Readings into the estimate; what was applied has moved it on by one period. Where nothing is to be learnt the temperatures
 * come from an estimator, which has looked at the sensors. */
static void observe(const lptn_mpc_settings *o, lptn_mpc_state *m, lptn_mpc_work *w, const double *measured,
                    const double *applied, lptn_mpc_result *out) {
    double variance[LPTN_NN];
    int use[LPTN_NN], stood[LPTN_NN];
    const int first = !m->started;
    if (first) {
        begin_estimate(o, m, measured);
    } else {
        for (int j = 0; j < LPTN_NU; j++)
            if (applied && isfinite(applied[j])) m->applied[j] = applied[j];
        predict(o, m, w);
    }
    for (int i = 0; i < LPTN_NN; i++) variance[i] = m->spread[i][0][0], stood[i] = m->sensors.silent[i];
    judge(&m->sensors, o->noise * o->noise - o->grain * o->grain, o->grain * SQRT_12, measured, m->x, variance, use);
    for (int i = 0; i < LPTN_NN; i++) {
        if (!(o->doubt[i] > 0)) use[i] = believed(measured[i]);
        else if (m->sensors.silent[i] && !stood[i]) take_back(o, m, i);
        if (use[i] && !first) correct_node(o, m, i, measured[i], use[i] > 1);
        if (believed(measured[i]) && m->sensors.since[i] == m->sensors.clock) fork_node(m, i);
        out->sensor[i] = use[i] ? LPTN_ALIVE
                         : !believed(measured[i]) ? LPTN_MISSING
                         : m->sensors.silent[i]   ? LPTN_STANDS
                                                  : LPTN_LEAPT;
        if (out->sensor[i] == LPTN_MISSING) out->status |= LPTN_UNMEASURED;
        else if (out->sensor[i] != LPTN_ALIVE) out->status |= LPTN_NOT_ALIVE;
    }
    for (int i = 0; i < LPTN_NX; i++)
        if (!believed(m->x[i])) m->x[i] = believed(m->x[o->owner[i]]) ? m->x[o->owner[i]] : hottest_limit(o);
}

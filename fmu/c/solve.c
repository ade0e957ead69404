/* Inner steps: RK4 or the L-stable Rosenbrock method ROS2, and the forecast of the time to each limit. */

#define MOST_STEPS 1e7
#define RK4_REACH 1.0  /* product of inner step and bound of the fastest rate; RK4 is stable to 2.78 */
#define FORECAST_REACH 2.0
#define FORECAST_STEPS 200.0

/* No eigenvalue of the Jacobian lies beyond this rate [1/s]. */
static double model_bound(Instance *I) {
    const double *arguments[] = {I->data.x, I->data.u, I->data.p};
    double *results[] = {&I->bound};
    if (!I->bound_known) lptn_bound(arguments, results, NULL, NULL, 0);
    I->bound_known = 1;
    return I->bound;
}

static void step_rk4(const double *x, const double *u0, const double *u1, const double *p, double h, double *after) {
    const double *arguments[] = {x, u0, u1, p, &h};
    double *results[] = {after};
    lptn_rk4(arguments, results, NULL, NULL, 0);
}

static void model_tangent(Instance *I, const double *x, const double *dx, const double *du, const double *dp, double *out) {
    const double *arguments[] = {x, I->data.u, I->data.p, dx, du, dp};
    double *results[] = {out};
    lptn_rates_forward(arguments, results, NULL, NULL, 0);
}

#if ROS2
/* Gauss with row exchange; zero where the matrix has no inverse. */
static int factorise(double *a, int *pivots) {
    int i, j, k;
    for (k = 0; k < NX; k++) {
        int best = k;
        for (i = k + 1; i < NX; i++)
            if (fabs(a[i + NX * k]) > fabs(a[best + NX * k])) best = i;
        if (!(fabs(a[best + NX * k]) > 0)) return 0;
        pivots[k] = best;
        if (best != k)
            for (j = 0; j < NX; j++) {
                double swap = a[k + NX * j];
                a[k + NX * j] = a[best + NX * j];
                a[best + NX * j] = swap;
            }
        for (i = k + 1; i < NX; i++) a[i + NX * k] /= a[k + NX * k];
        for (j = k + 1; j < NX; j++)
            for (i = k + 1; i < NX; i++) a[i + NX * j] -= a[i + NX * k] * a[k + NX * j];
    }
    return 1;
}

static void back_substitute(const double *a, const int *pivots, double *b) {
    int i, k;
    for (k = 0; k < NX; k++) {
        double swap = b[k];
        b[k] = b[pivots[k]];
        b[pivots[k]] = swap;
    }
    for (k = 0; k < NX; k++)
        for (i = k + 1; i < NX; i++) b[i] -= a[i + NX * k] * b[k];
    for (k = NX - 1; k >= 0; k--) {
        b[k] /= a[k + NX * k];
        for (i = 0; i < k; i++) b[i] -= a[i + NX * k] * b[k];
    }
}

/* Factors of I - gamma h J at the beginning of a step; a linear network keeps them from step to step. */
static int know_factors(Instance *I, const double *x, const double *u0, double gamma_h) {
    double jacobian[NX * NX];
    const double *arguments[] = {x, u0, I->data.p};
    double *results[] = {jacobian};
    int i;
    lptn_jacobian(arguments, results, NULL, NULL, 0);
    if (I->factored && gamma_h == I->factored_h && !memcmp(jacobian, I->jacobian, sizeof jacobian)) return 1;
    for (i = 0; i < NX * NX; i++) I->factors[i] = (i % (NX + 1) ? 0.0 : 1.0) - gamma_h * jacobian[i];
    memcpy(I->jacobian, jacobian, sizeof jacobian);
    I->factored_h = gamma_h;
    I->factored = factorise(I->factors, I->pivots);
    return I->factored;
}

/* Verwer's ROS2, second order whatever the Jacobian, L-stable; gamma = 1 - 1/sqrt(2). */
static int step_ros2(Instance *I, const double *x, const double *u0, const double *u1, double h, double *after) {
    const double gamma = 0.29289321881345247560;
    double k1[NX], k2[NX], middle[NX];
    int i;
    if (!know_factors(I, x, u0, gamma * h)) return 0;
    model_rates(x, u0, I->data.p, k1);
    back_substitute(I->factors, I->pivots, k1);
    for (i = 0; i < NX; i++) middle[i] = x[i] + h * k1[i];
    model_rates(middle, u1, I->data.p, k2);
    for (i = 0; i < NX; i++) k2[i] -= 2 * k1[i];
    back_substitute(I->factors, I->pivots, k2);
    for (i = 0; i < NX; i++) after[i] = x[i] + h * (1.5 * k1[i] + 0.5 * k2[i]);
    return 1;
}

/* The tangent along such a step: the same scheme and the same factors, for the tangent's Jacobian is the model's. */
static void tangent_ros2(Instance *I, const double *x, const double *dx, const double *du, const double *dp, double h,
                         double *after) {
    const double *u = I->data.u;
    double k[NX], k1[NX], k2[NX], middle[NX], moved[NX];
    int i;
    model_rates(x, u, I->data.p, k);
    back_substitute(I->factors, I->pivots, k);
    model_tangent(I, x, dx, du, dp, k1);
    back_substitute(I->factors, I->pivots, k1);
    for (i = 0; i < NX; i++) {
        middle[i] = x[i] + h * k[i];
        moved[i] = dx[i] + h * k1[i];
    }
    model_tangent(I, middle, moved, du, dp, k2);
    for (i = 0; i < NX; i++) k2[i] -= 2 * k1[i];
    back_substitute(I->factors, I->pivots, k2);
    for (i = 0; i < NX; i++) after[i] = dx[i] + h * (1.5 * k1[i] + 0.5 * k2[i]);
}
#endif

#if !ROS2
/* One RK4 step of the tangent along a step from x. The stages are repeated, for the step keeps none. */
static void tangent_rk4(Instance *I, const double *x, const double *dx, const double *du, const double *dp, double h,
                        double *after) {
    static const double share[] = {0.5, 0.5, 1.0}, weight[] = {2, 2, 1};
    const double *u = I->data.u, *p = I->data.p;
    double k[NX], t[NX], point[NX], moved[NX], sum[NX];
    int i, stage;
    model_rates(x, u, p, k);
    model_tangent(I, x, dx, du, dp, t);
    memcpy(sum, t, sizeof sum);
    for (stage = 0; stage < 3; stage++) {
        for (i = 0; i < NX; i++) {
            point[i] = x[i] + share[stage] * h * k[i];
            moved[i] = dx[i] + share[stage] * h * t[i];
        }
        model_rates(point, u, p, k);
        model_tangent(I, point, moved, du, dp, t);
        for (i = 0; i < NX; i++) sum[i] += weight[stage] * t[i];
    }
    for (i = 0; i < NX; i++) after[i] = dx[i] + h / 6 * sum[i];
}
#endif

static int inner_step(Instance *I, const double *x, const double *u0, const double *u1, double h, double *after) {
    int i;
#if ROS2
    if (!step_ros2(I, x, u0, u1, h, after)) return 0;
#else
    step_rk4(x, u0, u1, I->data.p, h, after);
#endif
    for (i = 0; i < NX; i++)
        if (!isfinite(after[i])) return 0;
    return 1;
}

/* How many inner steps a communication step takes: none longer than the exported one, none too long for RK4 at the
   present parameters and inputs. */
static double inner_steps(Instance *I, const char *function, double step) {
    double n = ceil(step / INNER_STEP * (1 - 1e-12));
    double needed;
    if (n < 1) n = 1;
    if (ROS2) return n;
    needed = ceil(step * model_bound(I) / RK4_REACH);
    if (!isfinite(needed)) return INFINITY;
    if (needed > n) {
        if (!I->warned_step) {
            I->warned_step = 1;
            core_warn(I, function, "inner steps of %g s are too long for these parameters and inputs: now %g s", step / n, step / needed);
        }
        n = needed;
    }
    return n;
}

/* The cubic through both ends of a step with their rates, at a share of the step. */
static double cubic(double y0, double y1, double r0, double r1, double h, double share) {
    double s = share, rest = 1 - share;
    return rest * rest * ((1 + 2 * s) * y0 + s * h * r0) + s * s * ((3 - 2 * s) * y1 - rest * h * r1);
}

static double slope_of_cubic(double y0, double y1, double r0, double r1, double h, double share) {
    double s = share, rest = 1 - share;
    return 6 * s * rest * (y1 - y0) / h + rest * (1 - 3 * s) * r0 + s * (3 * s - 2) * r1;
}

/* The share of a step at which that cubic, rising, meets a limit. */
static double crossing(double y0, double y1, double r0, double r1, double h, double limit) {
    double low = 0, high = 1;
    int i;
    for (i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);
        if (cubic(y0, y1, r0, r1, h, middle) < limit) low = middle;
        else high = middle;
    }
    return high;
}

/* The share of an inner step after which the first event is due, 1 where none is: where the cubic meets a limit, or on the
   way down the end of the hysteresis. */
static double event_in(const Instance *I, const double *after, const double *u0, const double *u1, double h) {
    const Data *d = &I->data;
    double r0[NX], r1[NX], first = 1;
    int i, known = 0;
    for (i = 0; i < NE; i++) {
        double way = d->crossed[i] ? -1 : 1, level = d->p[LIMITS + i] - (d->crossed[i] ? HYSTERESIS : 0), share;
        if (core_due(I, i) || way * after[i] < way * level) continue;
        if (!known++) {
            model_rates(d->x, u0, d->p, r0);
            model_rates(after, u1, d->p, r1);
        }
        share = crossing(way * d->x[i], way * after[i], way * r0[i], way * r1[i], h, way * level);
        if (share < first) first = share;
    }
    return first;
}

static Status core_step(Instance *I, const char *function, double from, double step, const Hooks *hooks, double *reached) {
    Data *d = &I->data;
    double n, h, time_before = d->time, x_before[NX], u_before[SPACE_U], u0[SPACE_U], u1[SPACE_U], after[NX];
    int64_t crossed_before[SPACE_E];
    uint64_t k, steps;
    int i, ends = 0;
    if (!(step > 0) || !isfinite(step)) return core_fail(I, function, "step size %g, must be positive", step);
    if (!(from + step > from)) return core_fail(I, function, "a step of %g s is lost in the rounding of the time %.17g", step, from);
    if (!(fabs(from - d->time) <= same_time(from, d->time, PART_OF_STEP * step)))
        return core_fail(I, function, "communication point %.17g, but the last step ended at %.17g", from, d->time);
    if (from + step - d->stop > same_time(from, from + step, PAST_STOP * step))
        return core_fail(I, function, "step to %.17g beyond the stop time %.17g", from + step, d->stop);
    n = inner_steps(I, function, step);
    if (!(n <= MOST_STEPS)) return core_fail(I, function, "%g inner steps needed; export with ros2 or step shorter", n);
    steps = (uint64_t)n;
    h = step / n;
    memcpy(x_before, d->x, sizeof x_before);
    memcpy(u_before, d->u, sizeof u_before);
    memcpy(u0, d->u, sizeof u0);
    memcpy(crossed_before, d->crossed, sizeof crossed_before);
    for (k = 0; k < steps && !ends; k++) {
        /* Of the step, not of the time: near 1.7e9 s a difference of times has lost a short step's last digits. */
        double gone = k + 1 == steps ? step : step * ((double)(k + 1) / n), end = from + gone;
        memcpy(u1, u0, sizeof u1);
        if (d->sloped)
            for (i = 0; i < NU; i++) u1[i] = u_before[i] + d->slope[i] * gone;
        if (hooks && hooks->before) {
            memcpy(d->u, u1, sizeof u1);
            hooks->before(I, end);
            memcpy(u1, d->u, sizeof u1);
        }
        int sound = inner_step(I, d->x, u0, u1, h, after);
        if (NE && sound && d->event_mode && !d->waiting && hooks->early) {
            double share = event_in(I, after, u0, u1, h);
            if (share < 1) { /* the step ends there, with an inner step of its own */
                for (i = 0; i < NU; i++) u1[i] = u0[i] + share * (u1[i] - u0[i]);
                end = from + (step * ((double)k / n) + share * h);
                sound = inner_step(I, d->x, u0, u1, share * h, after);
                ends = 1;
            }
        }
        if (!sound) {
            memcpy(d->x, x_before, sizeof x_before);
            memcpy(d->u, u_before, sizeof u_before);
            memcpy(d->crossed, crossed_before, sizeof crossed_before);
            d->time = *reached = time_before;
            core_forget(I);
            return core_fail(I, function, "temperatures run away before %g s; the step is taken back", end);
        }
        memcpy(d->x, after, sizeof after);
        memcpy(d->u, u1, sizeof u1);
        memcpy(u0, u1, sizeof u0);
        d->time = end;
        core_forget(I);
        for (i = 0; i < NE && !d->event_mode; i++)
            if (core_due(I, i)) d->crossed[i] = !d->crossed[i];
        if (hooks && hooks->after && hooks->after(I, end)) break;
    }
    if (d->event_mode) d->waiting = ends || core_any_due(I);
    memset(d->slope, 0, sizeof d->slope);
    d->sloped = 0;
    *reached = d->time;
    return OK;
}

/* --- the time to each limit ------------------------------------------------------------------------ */

/* Times to the limits with the inputs held, and with a seed (dx not null) how they move with it.
   Time t(x, u, p) where T(t) = limit: dt = (dlimit - dT) / (dT/dt). */
static void forecast(Instance *I, double *times, const double *dx0, const double *du, const double *dp, double *moved) {
    const double *u = I->data.u, *p = I->data.p;
    double horizon = p[HORIZON], x[NX], after[NX], r0[NX], r1[NX], dx[NX], dafter[NX], t0[NX], t1[NX];
    double bound = model_bound(I), longest = horizon / FORECAST_STEPS, t = 0, n, h;
    int i, open = 0, waiting[SPACE_Z];
    uint64_t k, steps;
    if (!ROS2 && bound * longest > FORECAST_REACH) longest = FORECAST_REACH / bound;
    n = ceil(horizon / longest);
    steps = n < MOST_STEPS ? (uint64_t)n : 0;
    h = horizon / n;
    memcpy(x, I->data.x, sizeof x);
    model_rates(x, u, p, r0);
    for (i = 0; i < NZ; i++) {
        waiting[i] = x[i] < p[LIMITS + i];
        open += waiting[i];
        times[i] = waiting[i] ? horizon : 0;
        if (dx0) moved[i] = waiting[i] ? dp[HORIZON] : 0;
    }
    if (dx0) {
        memcpy(dx, dx0, sizeof dx);
        model_tangent(I, x, dx, du, dp, t0);
    }
    for (k = 0; k < steps && open; k++, t += h) {
        if (!inner_step(I, x, u, u, h, after)) break;
        model_rates(after, u, p, r1);
        if (dx0) {
#if ROS2
            tangent_ros2(I, x, dx, du, dp, h, dafter);
#else
            tangent_rk4(I, x, dx, du, dp, h, dafter);
#endif
            model_tangent(I, after, dafter, du, dp, t1);
        }
        for (i = 0; i < NZ; i++) {
            double s, limit = p[LIMITS + i];
            if (!waiting[i] || after[i] < limit) continue;
            waiting[i] = 0;
            open--;
            s = crossing(x[i], after[i], r0[i], r1[i], h, limit);
            times[i] = t + s * h;
            if (dx0) {
                double rate = slope_of_cubic(x[i], after[i], r0[i], r1[i], h, s);
                moved[i] = (dp[LIMITS + i] - cubic(dx[i], dafter[i], t0[i], t1[i], h, s)) / rate;
            }
        }
        memcpy(x, after, sizeof x);
        memcpy(r0, r1, sizeof r0);
        if (dx0) {
            memcpy(dx, dafter, sizeof dx);
            memcpy(t0, t1, sizeof t0);
        }
    }
}

static void know_forecasts(Instance *I) {
    if (!I->forecasts_known) forecast(I, I->forecasts, NULL, NULL, NULL, NULL);
    I->forecasts_known = 1;
}

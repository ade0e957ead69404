/* The heat balance over one stage, linear about a temperature: exact for held inputs, by the matrix exponential.
 *
 * With rates k + A x + B s a stage is x+ = x + F (k + A x + B s), where F = h phi_1(hA) is the integral of exp(tA). A and B are
 * sparse: heat flows between neighbours, a joint heats its own motor. F alone is dense, and one product with it is all that a
 * stage costs, however it is used. */

#define FLOOR 1e-3 /* of the heat scale; 0.02 would cost optimality */
#define TERMS 7    /* of the Taylor series, at a norm up to 1/4 */

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && defined(LPTN_WIDE)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif

typedef double square[LPTN_NXP][LPTN_NXP];

/* Four numbers at once; a compiler without such registers makes four single ones of it, with the same digits. */
typedef double four __attribute__((vector_size(32), aligned(8)));

/* Rows i to i + 3 and columns j to j + 7 (j + 3 if not wide) of sum_l a[l][i] b[l][j], the sum over LPTN_NX; a may also be
 * read by rows. Eight sums at once keep the adders busy. */
static inline __attribute__((always_inline)) void block(int wide, double *out, const double *a, int row, int along,
                                                        const double *b) {
    four p[4] = {{0}}, q[4] = {{0}};
    for (int l = 0; l < LPTN_NX; l++, a += along, b += LPTN_NXP) {
        const four u = *(const four *)b, v = wide ? *(const four *)(b + 4) : u;
        p[0] += a[0] * u, p[1] += a[row] * u, p[2] += a[2 * row] * u, p[3] += a[3 * row] * u;
        if (wide) q[0] += a[0] * v, q[1] += a[row] * v, q[2] += a[2 * row] * v, q[3] += a[3 * row] * v;
    }
    for (int r = 0; r < 4; r++) {
        *(four *)(out + r * LPTN_NXP) = p[r];
        if (wide) *(four *)(out + r * LPTN_NXP + 4) = q[r];
    }
}

/* out = a b, or a'b where a is to be read by columns; of a symmetric product only the upper triangle. */
static inline __attribute__((always_inline)) void product(square out, square a, square b, int transposed, int symmetric) {
    for (int i = 0; i < LPTN_NXP; i += 4) {
        const double *left = transposed ? &a[0][i] : a[i];
        const int row = transposed ? 1 : LPTN_NXP, along = transposed ? LPTN_NXP : 1;
        int j = symmetric ? i : 0;
        for (; j + 8 <= LPTN_NXP; j += 8) block(1, &out[i][j], left, row, along, &b[0][j]);
        for (; j < LPTN_NXP; j += 4) block(0, &out[i][j], left, row, along, &b[0][j]);
    }
}

/* row += share other, from a column on. */
static inline __attribute__((always_inline)) void add_row(double *row, double share, const double *other, int from,
                                                          int width) {
    for (int j = from; j < width; j += 4) *(four *)(row + j) += share * *(const four *)(other + j);
}

/* Inner product of two rows from a column on. */
static inline double inner(const double *a, const double *b, int from, int width) {
    four sum = {0};
    for (int j = from; j < width; j += 4) sum += *(const four *)(a + j) * *(const four *)(b + j);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* F = h phi_1(hA), the integral of the exponential, by scaling and doubling; exp(hA) = I + hA phi_1(hA). */
WIDE static void integral(double h, const double *A, square F, square E, square T) {
    double norm = 0, sum[LPTN_NX] = {0};
    int doublings = 0;
    for (int n = 0; n < LPTN_NA; n++) sum[slope_row[n]] += fabs(A[n]);
    for (int i = 0; i < LPTN_NX; i++) norm = fmax(norm, sum[i] * h);
    while (norm > 0.25 && doublings < 30) norm /= 2, doublings++;
    double part = ldexp(h, -doublings);
    memset(F, 0, sizeof(square));
    for (int i = 0; i < LPTN_NX; i++) F[i][i] = 1;
    for (int term = TERMS; term > 1; term--) {
        memset(T, 0, sizeof(square));
        for (int n = 0; n < LPTN_NA; n++) add_row(T[slope_row[n]], part / term * A[n], F[slope_column[n]], 0, LPTN_NXP);
        for (int i = 0; i < LPTN_NX; i++) T[i][i] += 1;
        memcpy(F, T, sizeof(square));
    }
    for (; doublings > 0; doublings--, part *= 2) {
        memset(E, 0, sizeof(square));
        for (int n = 0; n < LPTN_NA; n++) add_row(E[slope_row[n]], 0.5 * part * A[n], F[slope_column[n]], 0, LPTN_NXP);
        for (int i = 0; i < LPTN_NX; i++) E[i][i] += 1;
        product(T, E, F, 0, 0); /* phi_1(2Z) = (exp(Z) + I)/2 phi_1(Z) */
        memcpy(F, T, sizeof(square));
    }
    for (int i = 0; i < LPTN_NX; i++)
        for (int j = 0; j < LPTN_NXP; j++) F[i][j] *= h;
}

/* The model at a point: rates without the controlled heat, their slope in the states, the controlled heat's rates (of the
 * last two what is not zero everywhere: see pattern.h), and amperes per unit requested. */
static void evaluate(const lptn_mpc_settings *o, lptn_mpc_work *w, const double *x, const double *heat, const double *d,
                     double **rates, double **slope, double **controlled, double **gain) {
    const double *arg[LPTN_HEAT_ARG] = {x, heat, d, o->p};
    double *res[LPTN_HEAT_RES];
    long long integers[LPTN_HEAT_IW + 1];
    res[0] = *rates = w->heat;
    res[1] = *slope = *rates + LPTN_NX;
    res[2] = *controlled = *slope + LPTN_NA;
    res[3] = *gain = *controlled + LPTN_NB;
    lptn_heat(arg, res, integers, w->casadi, 0);
}

static const double *gain_at(const lptn_mpc_settings *o, lptn_mpc_work *w, const double *x, const double *d) {
    double none[LPTN_NU] = {0}, *rates, *slope, *controlled, *gain;
    evaluate(o, w, x, none, d, &rates, &slope, &controlled, &gain);
    return gain;
}

/* A stage of h seconds about a point, with s shaping the slope; bias and gain are what the model was found to lack. */
static void make_stage(const lptn_mpc_settings *o, lptn_mpc_work *w, double h, const double *at, const double *s,
                       const double *c, const double *d, lptn_mpc_stage *stage) {
    double square_of[LPTN_NU], heat[LPTN_NU], *rates, *slope, *controlled, *gain;
    for (int j = 0; j < LPTN_NU; j++) square_of[j] = c[j] * c[j], heat[j] = s[j] * square_of[j];
    evaluate(o, w, at, heat, d, &rates, &slope, &controlled, &gain);
    for (int i = 0; i < LPTN_NX; i++) stage->k[i] = rates[i] + w->bias[i];
    for (int n = 0; n < LPTN_NA; n++) {
        stage->A[n] = slope[n];
        stage->k[slope_row[n]] -= slope[n] * at[slope_column[n]];
    }
    for (int n = 0; n < LPTN_NB; n++)
        stage->B[n] = (1 + w->gain[heated_row[n]]) * controlled[n] * square_of[heated_column[n]];
    integral(h, stage->A, stage->F, w->square[0], w->square[1]);
}

static void linearise(const lptn_mpc_settings *o, lptn_mpc_work *w, int k, const double *at) {
    make_stage(o, w, o->stage[k], at, w->s[k], w->c[k], w->d[k], &w->stage[k]);
}

/* next += F (A x + B s). */
WIDE static void add_change(const lptn_mpc_stage *stage, const double *x, const double *s, double *rates, double *next) {
    for (int n = 0; n < LPTN_NA; n++) rates[slope_row[n]] += stage->A[n] * x[slope_column[n]];
    for (int n = 0; n < LPTN_NB; n++) rates[heated_row[n]] += stage->B[n] * s[heated_column[n]];
    for (int i = 0; i < LPTN_NX; i++) next[i] += inner(stage->F[i], rates, 0, LPTN_NXP);
}

static void advance(const lptn_mpc_stage *stage, const double *x, const double *s, double *next) {
    double rates[LPTN_NXP] = {0};
    memcpy(rates, stage->k, sizeof stage->k);
    for (int n = 0; n < LPTN_NX; n++) next[n] = x[n];
    add_change(stage, x, s, rates, next);
}

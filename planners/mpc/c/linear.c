/* The heat balance over one stage, linear about a temperature: exact for held inputs, by the matrix exponential. */

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

/* Rows i to i + 3 and columns j to j + 3 of sum_l a[l][i] b[l][j], the sum over LPTN_NX; a may also be read by rows. */
static inline __attribute__((always_inline)) void block(double *out, int width, const double *a, int row, int along,
                                                        const double *b, int below) {
    four sum[4] = {{0}};
    for (int l = 0; l < LPTN_NX; l++) {
        const four each = *(const four *)(b + l * below);
        sum[0] += a[l * along] * each;
        sum[1] += a[l * along + row] * each;
        sum[2] += a[l * along + 2 * row] * each;
        sum[3] += a[l * along + 3 * row] * each;
    }
    for (int r = 0; r < 4; r++) *(four *)(out + r * width) = sum[r];
}

/* out = a b. */
static inline __attribute__((always_inline)) void product(square out, square a, square b) {
    for (int i = 0; i < LPTN_NXP; i += 4)
        for (int j = 0; j < LPTN_NXP; j += 4) block(&out[i][j], LPTN_NXP, a[i], LPTN_NXP, 1, &b[0][j], LPTN_NXP);
}

/* E = exp(hA) and F = h phi_1(hA), the integral of the exponential, by scaling and squaring. */
WIDE static void exponential(double h, const double *A, square E, square F) {
    square Z = {{0}}, T;
    double norm = 0;
    int doublings = 0;
    for (int i = 0; i < LPTN_NX; i++) {
        double sum = 0;
        for (int j = 0; j < LPTN_NX; j++) sum += fabs(A[i * LPTN_NX + j]);
        norm = fmax(norm, sum * h);
    }
    while (norm > 0.25 && doublings < 30) norm /= 2, doublings++;
    const double part = ldexp(h, -doublings);
    for (int i = 0; i < LPTN_NX; i++)
        for (int j = 0; j < LPTN_NX; j++) Z[i][j] = part * A[i * LPTN_NX + j];
    memset(F, 0, sizeof(square)), memset(E, 0, sizeof(square));
    for (int i = 0; i < LPTN_NX; i++) F[i][i] = 1;
    for (int n = TERMS; n > 1; n--) {
        product(T, Z, F);
        for (int i = 0; i < LPTN_NX; i++)
            for (int j = 0; j < LPTN_NXP; j++) F[i][j] = T[i][j] / n + (i == j);
    }
    product(E, Z, F);
    for (int i = 0; i < LPTN_NX; i++) E[i][i] += 1;
    for (int n = 0; n < doublings; n++) {
        for (int i = 0; i < LPTN_NX; i++)
            for (int j = 0; j < LPTN_NXP; j++) Z[i][j] = 0.5 * (E[i][j] + (i == j));
        product(T, Z, F);
        memcpy(F, T, sizeof(square));
        product(T, E, E);
        memcpy(E, T, sizeof(square));
    }
    for (int i = 0; i < LPTN_NX; i++)
        for (int j = 0; j < LPTN_NXP; j++) F[i][j] *= h;
}

/* The model at a point: rates without the controlled heat, their slope in the states, the controlled heat's rates. */
static void evaluate(const lptn_mpc_settings *o, lptn_mpc_work *w, const double *x, const double *heat, const double *d,
                     double **rates, double **slope, double **controlled, double **gain) {
    const double *arg[LPTN_HEAT_ARG] = {x, heat, d, o->p};
    double *res[LPTN_HEAT_RES];
    long long integers[LPTN_HEAT_IW + 1];
    res[0] = *rates = w->heat;
    res[1] = *slope = *rates + LPTN_NX;
    res[2] = *controlled = *slope + LPTN_NX * LPTN_NX;
    res[3] = *gain = *controlled + LPTN_NX * LPTN_NU;
    lptn_heat(arg, res, integers, w->casadi, 0);
}

static const double *gain_at(const lptn_mpc_settings *o, lptn_mpc_work *w, const double *x, const double *d) {
    double none[LPTN_NU] = {0}, *rates, *slope, *controlled, *gain;
    evaluate(o, w, x, none, d, &rates, &slope, &controlled, &gain);
    return gain;
}

/* x+ = E x + F (rates - slope x + bias + controlled s) about a point, with s shaping the slope;
 * bias and gain are what the model was found to lack. */
static void stage_matrices(const lptn_mpc_settings *o, lptn_mpc_work *w, double h, const double *at, const double *s,
                           const double *c, const double *d, double M[LPTN_NX][LPTN_W], double *offset) {
    double square_of[LPTN_NU], heat[LPTN_NU], constant[LPTN_NX], *rates, *slope, *controlled, *gain;
    square E, F;
    for (int j = 0; j < LPTN_NU; j++) square_of[j] = c[j] * c[j], heat[j] = s[j] * square_of[j];
    evaluate(o, w, at, heat, d, &rates, &slope, &controlled, &gain);
    exponential(h, slope, E, F);
    for (int i = 0; i < LPTN_NX; i++) {
        constant[i] = rates[i] + w->bias[i];
        for (int l = 0; l < LPTN_NX; l++) constant[i] -= slope[i * LPTN_NX + l] * at[l];
    }
    for (int i = 0; i < LPTN_NX; i++) {
        double sum = 0, row[LPTN_NU] = {0};
        for (int l = 0; l < LPTN_NX; l++) {
            sum += F[i][l] * constant[l];
            for (int j = 0; j < LPTN_NU; j++) row[j] += F[i][l] * (1 + w->gain[l]) * controlled[l * LPTN_NU + j];
        }
        offset[i] = sum;
        for (int j = 0; j < LPTN_NU; j++) M[i][j] = row[j] * square_of[j];
        for (int l = 0; l < LPTN_NX; l++) M[i][LPTN_NU + l] = E[i][l];
        for (int l = LPTN_NU + LPTN_NX; l < LPTN_W; l++) M[i][l] = 0;
    }
}

static void linearise(const lptn_mpc_settings *o, lptn_mpc_work *w, int k, const double *at) {
    stage_matrices(o, w, o->stage[k], at, w->s[k], w->c[k], w->d[k], w->M[k], w->offset[k]);
}

static void advance(const lptn_mpc_work *w, int k, const double *x, const double *s, double *next) {
    double following[LPTN_NX];
    for (int i = 0; i < LPTN_NX; i++) {
        double sum = w->offset[k][i];
        for (int j = 0; j < LPTN_NU; j++) sum += w->M[k][i][j] * s[j];
        for (int l = 0; l < LPTN_NX; l++) sum += w->M[k][i][LPTN_NU + l] * x[l];
        following[i] = sum;
    }
    memcpy(next, following, sizeof following);
}

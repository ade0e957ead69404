/* Runge-Kutta steps of a model and, along with them, of the derivatives of its states.
 *
 * Compiled once for all models. It is given two functions that CasADi generates from a model:
 *   rates(x, u, p)  -> dx/dt
 *   slopes(x, u, p) -> dx/dt, then the nonzeros of its derivatives by the core states (A) and by the
 *                      chosen parameters (B), in the order in which `pattern` lists them.
 * S holds d(core states)/d(chosen parameters, core states at the start), one row a state, and follows
 *   dS/dt = A S + [B 0].
 */
#include <string.h>

/* One library for every processor: the loops twice, with and without wide vectors, chosen when it is loaded. */
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif

typedef long long integer;
typedef int function(const double **arg, double **res, integer *iw, double *w, int mem);

typedef struct {
    function *rates, *slopes;
    integer states, core, chosen; /* all states; those whose derivatives are followed; parameters to derive by */
    integer nonzeros_a, nonzeros_b;
    const integer *pattern; /* rows of A, columns of A, rows of B, columns of B */
    integer arguments, results, integers, doubles; /* what the generated functions need to work in */
} shape;

static inline void call(function *f, const double *x, const double *u, const double *p, double *out,
                        const double **arg, double **res, integer *iw, double *w) {
    arg[0] = x, arg[1] = u, arg[2] = p;
    res[0] = out;
    f(arg, res, iw, w, 0);
}

/* out = A in + [B 0], A and B sparse. */
static inline void derive(const shape *s, const double *nonzeros, const double *in, double *out) {
    const integer width = s->chosen + s->core;
    const integer *row = s->pattern, *column = row + s->nonzeros_a;
    memset(out, 0, (size_t)(s->core * width) * sizeof(double));
    for (integer k = 0; k < s->nonzeros_a; k++) {
        const double a = nonzeros[k];
        const double *from = in + column[k] * width;
        double *to = out + row[k] * width;
        for (integer j = 0; j < width; j++) to[j] += a * from[j];
    }
    row = column + s->nonzeros_a, column = row + s->nonzeros_b, nonzeros += s->nonzeros_a;
    for (integer k = 0; k < s->nonzeros_b; k++) out[row[k] * width + column[k]] += nonzeros[k];
}

static inline void combine(integer n, double *out, const double *base, double share, const double *slope) {
    for (integer j = 0; j < n; j++) out[j] = base[j] + share * slope[j];
}

/* Doubles of working memory that `run` needs, beside pointers and integers. */
integer working_doubles(const shape *s) {
    const integer block = s->core * (s->chosen + s->core);
    return s->doubles + 3 * s->states + s->nonzeros_a + s->nonzeros_b + 3 * block;
}

/* n steps of `parts` internal steps of h seconds each; row k of X and S holds what stands after k steps.
 *
 * x: (n + 1, states), its first row given. S: (n + 1, core, chosen + core), its first block given; NULL for
 * the states alone. u: (n, inputs). */
WIDE void run(const shape *s, integer n, integer parts, double h, integer inputs, const double *u, const double *p,
              double *X, double *S, const double **arg, double **res, integer *iw, double *work) {
    const integer states = s->states, block = s->core * (s->chosen + s->core);
    const double share[4] = {0.0, h / 2, h / 2, h}, weight[4] = {h / 6, h / 3, h / 3, h / 6};
    double *w = work, *point = w + s->doubles, *sum = point + states, *slope = sum + states;
    double *moved = slope + states + s->nonzeros_a + s->nonzeros_b, *total = moved + block, *change = total + block;
    function *f = S ? s->slopes : s->rates;
    for (integer k = 0; k < n; k++, u += inputs) {
        double *x = X + (k + 1) * states, *d = S ? S + (k + 1) * block : NULL;
        memcpy(x, x - states, (size_t)states * sizeof(double));
        if (S) memcpy(d, d - block, (size_t)block * sizeof(double));
        for (integer part = 0; part < parts; part++) {
            memcpy(sum, x, (size_t)states * sizeof(double));
            if (S) memcpy(total, d, (size_t)block * sizeof(double));
            for (int stage = 0; stage < 4; stage++) {
                /* `slope` and `change` still hold what the stage before found. */
                if (stage) combine(states, point, x, share[stage], slope);
                else memcpy(point, x, (size_t)states * sizeof(double));
                if (S && stage) combine(block, moved, d, share[stage], change);
                else if (S) memcpy(moved, d, (size_t)block * sizeof(double));
                call(f, point, u, p, slope, arg, res, iw, w);
                combine(states, sum, sum, weight[stage], slope);
                if (S) {
                    derive(s, slope + states, moved, change);
                    combine(block, total, total, weight[stage], change);
                }
            }
            memcpy(x, sum, (size_t)states * sizeof(double));
            if (S) memcpy(d, total, (size_t)block * sizeof(double));
        }
    }
}

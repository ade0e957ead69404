/* Runge-Kutta steps of a model and, along with them, of the derivatives of its states.
 *
 * Compiled once for all models. A model comes as data: its rates dx/dt = f(x, u, p), and the nonzeros of their
 * derivatives by the core states (A) and by the chosen parameters (B), are a list of operations on numbered values.
 * S holds d(core states)/d(chosen parameters, core states at the start), one row a state, and follows
 *   dS/dt = A S + [B 0].
 */
#include <math.h>
#include <string.h>

/* One library for every processor: the loops twice, with and without wide vectors, chosen when it is loaded. */
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif

typedef long long integer;

/* Values are numbered: states, inputs, parameters, constants, then the result of each operation. What depends on
 * parameters alone is worked out once a run, what depends on inputs beside them once a step, the rest in each stage;
 * what dx/dt does not need stands last. Operations of one kind that do not need each other stand together, as a group. */
typedef struct {
    integer states, inputs, parameters, values, results;
    integer groups[5]; /* of parameters: from groups[0] to groups[1]; of inputs; of states; of derivatives */
    integer first[4];  /* number of the first value that each of these four works out */
    const integer *group; /* kind of operation, and how many of them, for each group */
    const int *left, *right; /* operands of each value; those of one operand have it twice */
    const int *result; /* values that are dx/dt, then the nonzeros of A, then those of B */
    const double *initial; /* values, constants in their places */
    integer core, chosen; /* states whose derivatives are followed; parameters to derive by */
    integer nonzeros_a, nonzeros_b;
    const integer *pattern; /* rows of A, columns of A, rows of B, columns of B */
} model;

enum { PARAMETERS, INPUTS, STATES, DERIVATIVES };

static void evaluate(const model *m, int part, double *v) {
    const int *left = m->left, *right = m->right;
    integer k = m->first[part];
    for (integer g = m->groups[part]; g < m->groups[part + 1]; g++) {
        const integer stop = k + m->group[2 * g + 1];
        switch (m->group[2 * g]) {
#define OPERATION(kind, expression)                    \
    case kind:                                         \
        for (; k < stop; k++) {                        \
            const double a = v[left[k]], b = v[right[k]]; \
            (void)b;                                   \
            v[k] = (expression);                       \
        }                                              \
        break;
#include "operations.h"
        }
    }
}

/* dx/dt and, if they are asked for, its derivatives. */
static inline void results_at(const model *m, const double *x, double *v, int derivatives, double *out) {
    const integer count = derivatives ? m->results : m->states;
    memcpy(v, x, (size_t)m->states * sizeof(double));
    evaluate(m, STATES, v);
    if (derivatives) evaluate(m, DERIVATIVES, v);
    for (integer k = 0; k < count; k++) out[k] = v[m->result[k]];
}

/* out = A in + [B 0], A and B sparse. */
static inline void derive(const model *m, const double *nonzeros, const double *in, double *out) {
    const integer width = m->chosen + m->core;
    const integer *row = m->pattern, *column = row + m->nonzeros_a;
    memset(out, 0, (size_t)(m->core * width) * sizeof(double));
    for (integer k = 0; k < m->nonzeros_a; k++) {
        const double a = nonzeros[k];
        const double *from = in + column[k] * width;
        double *to = out + row[k] * width;
        for (integer j = 0; j < width; j++) to[j] += a * from[j];
    }
    row = column + m->nonzeros_a, column = row + m->nonzeros_b, nonzeros += m->nonzeros_a;
    for (integer k = 0; k < m->nonzeros_b; k++) out[row[k] * width + column[k]] += nonzeros[k];
}

static inline void combine(integer n, double *out, const double *base, double share, const double *slope) {
    for (integer j = 0; j < n; j++) out[j] = base[j] + share * slope[j];
}

/* Doubles of working memory that `run` needs. */
integer working_doubles(const model *m) {
    const integer block = m->core * (m->chosen + m->core);
    return m->values + 2 * m->states + m->results + 3 * block;
}

/* The results at n points: x (n, states), u (n, inputs), p common to all; out (n, results). */
WIDE void at_points(const model *m, integer n, const double *x, const double *u, const double *p, double *out,
                    double *work) {
    memcpy(work, m->initial, (size_t)m->values * sizeof(double));
    memcpy(work + m->states + m->inputs, p, (size_t)m->parameters * sizeof(double));
    evaluate(m, PARAMETERS, work);
    for (integer k = 0; k < n; k++, x += m->states, u += m->inputs, out += m->results) {
        memcpy(work + m->states, u, (size_t)m->inputs * sizeof(double));
        evaluate(m, INPUTS, work);
        results_at(m, x, work, 1, out);
    }
}

/* n rows of `parts` steps of h seconds each.
 *
 * X: (n + 1, states), at the ends of rows, its first row given. H: (n, states), means over rows; a null pointer where
 * none are asked for. S: (core, chosen + core), derivatives at the start, and when all is done at the end; a null
 * pointer where none are to be followed. D: (n, core, chosen + core), derivatives of the means, or without them of the
 * states at the starts of rows. u: (n, inputs). mean: what a step's mean has of each of its four slopes. */
WIDE void run(const model *m, integer n, integer parts, double h, const double *mean, const double *u, const double *p,
              double *X, double *H, double *S, double *D, double *work) {
    const integer states = m->states, block = S ? m->core * (m->chosen + m->core) : 0;
    const double share[4] = {0.0, h / 2, h / 2, h}, weight[4] = {h / 6, h / 3, h / 3, h / 6}, one = 1.0 / parts;
    double *v = work, *point = v + m->values, *sum = point + states, *slope = sum + states;
    double *moved = slope + m->results, *total = moved + block, *change = total + block;
    memcpy(v, m->initial, (size_t)m->values * sizeof(double));
    memcpy(v + states + m->inputs, p, (size_t)m->parameters * sizeof(double));
    evaluate(m, PARAMETERS, v);
    for (integer k = 0; k < n; k++, u += m->inputs) {
        double *x = X + (k + 1) * states, *row = H ? H + k * states : 0, *d = block ? D + k * block : 0;
        memcpy(v + states, u, (size_t)m->inputs * sizeof(double));
        evaluate(m, INPUTS, v);
        memcpy(x, x - states, (size_t)states * sizeof(double));
        if (row) memset(row, 0, (size_t)states * sizeof(double));
        if (block && row) memset(d, 0, (size_t)block * sizeof(double));
        else if (block) memcpy(d, S, (size_t)block * sizeof(double));
        for (integer part = 0; part < parts; part++) {
            memcpy(sum, x, (size_t)states * sizeof(double));
            if (row) combine(states, row, row, one, x);
            if (block) memcpy(total, S, (size_t)block * sizeof(double));
            if (block && row) combine(block, d, d, one, S);
            for (int stage = 0; stage < 4; stage++) {
                /* `slope` and `change` still hold what the stage before found. */
                if (stage) combine(states, point, x, share[stage], slope);
                else memcpy(point, x, (size_t)states * sizeof(double));
                if (block && stage) combine(block, moved, S, share[stage], change);
                else if (block) memcpy(moved, S, (size_t)block * sizeof(double));
                results_at(m, point, v, block > 0, slope);
                combine(states, sum, sum, weight[stage], slope);
                if (row) combine(states, row, row, one * h * mean[stage], slope);
                if (block) {
                    derive(m, slope + states, moved, change);
                    combine(block, total, total, weight[stage], change);
                    if (row) combine(block, d, d, one * h * mean[stage], change);
                }
            }
            memcpy(x, sum, (size_t)states * sizeof(double));
            if (block) memcpy(S, total, (size_t)block * sizeof(double));
        }
    }
}

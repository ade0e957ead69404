/* Newton steps of the interior point: everything but the scales eliminated, stage by stage, by a Riccati recursion. */

/* Curvature of each scale and each limited temperature, all else eliminated. */
static void curvatures(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            const double s = w->s[k][j];
            w->R[k][j] = 0.5 * w->a[k][j] / (s * sqrt(s)) + w->zl[k][j] / (s - w->lo[k][j]) +
                         w->zu[k][j] / (w->hi[k][j] - s);
        }
        for (int l = 0; l < LPTN_NL; l++) {
            const double Y = w->y[k][l] / w->t[k][l], V = w->z[k][l] / w->e[k][l];
            w->row[k][l] = o->quadratic + Y + V;
            w->Q[k][l] = Y * (o->quadratic + V) / w->row[k][l];
        }
    }
}

/* Slopes for a target mu; cl, cu, ct, ce hold the second-order corrections. */
static void slopes(const lptn_mpc_settings *o, lptn_mpc_work *w, double mu) {
    for (int k = 0; k < LPTN_N; k++) {
        for (int j = 0; j < LPTN_NU; j++) {
            const double s = w->s[k][j];
            w->r[k][j] = w->a[k][j] - w->a[k][j] / sqrt(s) - (mu - w->cl[k][j]) / (s - w->lo[k][j]) +
                         (mu - w->cu[k][j]) / (w->hi[k][j] - s);
        }
        for (int l = 0; l < LPTN_NL; l++) {
            const double t = w->t[k][l], e = w->e[k][l], y = w->y[k][l], z = w->z[k][l], Y = y / t, D = w->row[k][l];
            const double short_of = w->limit[k][l] + e - w->x[k + 1][o->node[l]] - t;
            const double price = o->linear + o->quadratic * e - y - z;
            const double to_y = (mu - w->ct[k][l]) / t, to_z = (mu - w->ce[k][l]) / e;
            const double c = to_y - y + to_z - z - price;
            w->q[k][l] = to_y - Y * short_of - Y * (c - Y * short_of) / D;
        }
    }
}

/* Backward sweep: cost to go, the scales of each stage eliminated by pivots. Only the upper triangles are kept. */
WIDE static int factorise(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    square P = {{0}};
    double PM[LPTN_NXP][LPTN_W];
    for (int k = LPTN_N - 1; k >= 0; k--) {
        double(*M)[LPTN_W] = w->M[k], (*U)[LPTN_W] = w->U[k];
        for (int l = 0; l < LPTN_NL; l++) P[o->node[l]][o->node[l]] += w->Q[k][l];
        memcpy(w->P[k], P, sizeof w->P[k]);
        for (int i = 0; i < LPTN_NXP; i += 4)
            for (int j = 0; j < LPTN_W; j += 4) block(&PM[i][j], LPTN_W, &P[0][i], 1, LPTN_NXP, &M[0][j], LPTN_W);
        for (int i = 0; i < LPTN_W; i += 4)
            for (int j = i; j < LPTN_W; j += 4) block(&U[i][j], LPTN_W, &M[0][i], 1, LPTN_W, &PM[0][j], LPTN_W);
        for (int j = 0; j < LPTN_NU; j++) {
            U[j][j] += w->R[k][j];
            if (!(U[j][j] > 0)) return 0;
            const double inverse = 1 / U[j][j];
            for (int i = j + 1; i < LPTN_NU + LPTN_NX; i++) {
                const double share = U[j][i] * inverse;
                for (int l = i & ~3; l < LPTN_W; l += 4) *(four *)&U[i][l] -= share * *(four *)&U[j][l];
            }
        }
        for (int i = 0; i < LPTN_NX; i++)
            for (int l = i; l < LPTN_NX; l++) P[i][l] = P[l][i] = U[LPTN_NU + i][LPTN_NU + l];
    }
    return 1;
}

/* Inner product of two rows from a column on. */
static inline double inner(const double *a, const double *b, int from) {
    four sum = {0};
    for (int j = from; j < LPTN_W; j += 4) sum += *(const four *)(a + j) * *(const four *)(b + j);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Newton step of the scales and, by them, of everything else. */
WIDE static void direction(const lptn_mpc_settings *o, lptn_mpc_work *w, double mu) {
    double g[LPTN_NX] = {0};
    slopes(o, w, mu);
    for (int k = LPTN_N - 1; k >= 0; k--) {
        double v[LPTN_W] = {0};
        for (int l = 0; l < LPTN_NL; l++) g[o->node[l]] += w->q[k][l];
        for (int l = 0; l < LPTN_NX; l++)
            for (int i = 0; i < LPTN_NX; i++) g[i] += w->P[k][l][i] * w->gap[k][l];
        for (int j = 0; j < LPTN_NU; j++) v[j] = w->r[k][j];
        for (int j = 0; j < LPTN_W; j += 4)
            for (int l = 0; l < LPTN_NX; l++) *(four *)(v + j) += g[l] * *(four *)&w->M[k][l][j];
        for (int j = 0; j < LPTN_NU; j++) {
            const double share = v[j] / w->U[k][j][j];
            w->v[k][j] = v[j];
            for (int i = j & ~3; i < LPTN_W; i += 4) *(four *)(v + i) -= share * *(four *)&w->U[k][j][i];
        }
        for (int i = 0; i < LPTN_NX; i++) g[i] = v[LPTN_NU + i];
    }
    memset(w->dx[0], 0, sizeof w->dx[0]);
    for (int k = 0; k < LPTN_N; k++) {
        double step[LPTN_W] = {0};
        memcpy(step + LPTN_NU, w->dx[k], sizeof w->dx[k]);
        for (int j = LPTN_NU - 1; j >= 0; j--) step[j] = -(w->v[k][j] + inner(w->U[k][j], step, j & ~3)) / w->U[k][j][j];
        memcpy(w->ds[k], step, sizeof w->ds[k]);
        for (int i = 0; i < LPTN_NX; i++) w->dx[k + 1][i] = inner(w->M[k][i], step, 0) + w->gap[k][i];
        for (int j = 0; j < LPTN_NU; j++) {
            const double s = w->s[k][j], below = s - w->lo[k][j], above = w->hi[k][j] - s, ds = w->ds[k][j];
            w->dl[k][j] = (mu - w->cl[k][j]) / below - w->zl[k][j] - w->zl[k][j] / below * ds;
            w->du[k][j] = (mu - w->cu[k][j]) / above - w->zu[k][j] + w->zu[k][j] / above * ds;
        }
        for (int l = 0; l < LPTN_NL; l++) {
            const double t = w->t[k][l], e = w->e[k][l], y = w->y[k][l], z = w->z[k][l];
            const double dx = w->dx[k + 1][o->node[l]];
            const double short_of = w->limit[k][l] + e - w->x[k + 1][o->node[l]] - t;
            const double price = o->linear + o->quadratic * e - y - z;
            const double to_y = (mu - w->ct[k][l]) / t, to_z = (mu - w->ce[k][l]) / e;
            const double c = to_y - y + to_z - z - price;
            w->de[k][l] = (y / t * (dx - short_of) + c) / w->row[k][l];
            w->dt[k][l] = w->de[k][l] - dx + short_of;
            w->dy[k][l] = to_y - y - y / t * w->dt[k][l];
            w->dz[k][l] = to_z - z - z / e * w->de[k][l];
        }
    }
}

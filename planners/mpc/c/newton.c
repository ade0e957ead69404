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

/* U's row i, from column `from` on, less what four pivots' rows make of it. */
static inline __attribute__((always_inline)) void subtract_four(double (*U)[LPTN_W], int first, int i, const double *share,
                                                                int from) {
    for (int l = from; l < LPTN_W; l += 4) {
        const four a = share[0] * *(const four *)&U[first][l], b = share[1] * *(const four *)&U[first + 1][l];
        const four c = share[2] * *(const four *)&U[first + 2][l], d = share[3] * *(const four *)&U[first + 3][l];
        *(four *)&U[i][l] -= (a + b) + (c + d);
    }
}

/* Pivots of the first LPTN_NU rows of a symmetric U, four at a time so that the rows below are passed through a quarter as
 * often; only the upper triangle is kept. */
static inline __attribute__((always_inline)) int eliminate(double (*U)[LPTN_W]) {
    for (int first = 0; first < LPTN_NU; first += 4) {
        const int many = LPTN_NU - first < 4 ? LPTN_NU - first : 4;
        for (int j = first; j < first + many; j++) {
            if (!(U[j][j] > 0)) return 0;
            for (int i = j + 1; i < first + many; i++) add_row(U[i], -U[j][i] / U[j][j], U[j], i & ~3, LPTN_W);
        }
        for (int i = first + many; i < LPTN_NU + LPTN_NX; i++) {
            double share[4];
            for (int j = 0; j < many; j++) share[j] = U[first + j][i] / U[first + j][first + j];
            if (many == 4) subtract_four(U, first, i, share, i & ~3);
            else
                for (int j = 0; j < many; j++) add_row(U[i], -share[j], U[first + j], i & ~3, LPTN_W);
        }
    }
    return 1;
}

/* Backward sweep: cost to go P of the states, the scales of each stage eliminated by pivots.
 *
 * By x+ = x + F (A x + B s) a stage's quadratic form is, with D = F'P and N = F'P F,
 *     B'N B + R in the scales,   B'(D + N A) in scales and states,   P + A'D + D'A + A'N A in the states.
 * A and B are sparse: two products, one of them of half the size since N is symmetric, are all there is beside pivots. */
WIDE static int factorise(const lptn_mpc_settings *o, lptn_mpc_work *w) {
    double(*P)[LPTN_NXP] = w->square[0], (*D)[LPTN_NXP] = w->square[1], (*N)[LPTN_NXP] = w->square[2];
    double(*S)[LPTN_NXP] = w->square[3], (*U)[LPTN_W] = w->form, (*C)[LPTN_W] = w->right;
    memset(P, 0, sizeof w->square[0]);
    for (int k = LPTN_N - 1; k >= 0; k--) {
        lptn_mpc_stage *stage = &w->stage[k];
        double(*F)[LPTN_NXP] = stage->F;
        for (int l = 0; l < LPTN_NL; l++) P[o->node[l]][o->node[l]] += w->Q[k][l];
        memcpy(w->P[k], P, sizeof w->P[k]);
        product(D, F, P, 1, 0);
        product(N, D, F, 0, 1);
        for (int i = 0; i < LPTN_NX; i++)
            for (int l = 0; l < i; l++) N[i][l] = N[l][i];
        /* C = [N B, D + N A] and, in D, half of A's share: D + N A / 2. */
        memset(S, 0, sizeof w->square[3]), memset(C, 0, sizeof w->right);
        for (int n = 0; n < LPTN_NA; n++) add_row(S[slope_column[n]], stage->A[n], N[slope_row[n]], 0, LPTN_NXP);
        for (int l = 0; l < LPTN_NX; l++) {
            for (int n = 0; n < LPTN_NB; n++) C[l][heated_column[n]] += N[l][heated_row[n]] * stage->B[n];
            for (int i = 0; i < LPTN_NX; i++) {
                C[l][LPTN_NU + i] = D[l][i] + S[i][l];
                D[l][i] += 0.5 * S[i][l];
            }
        }
        memset(U, 0, sizeof w->form), memset(S, 0, sizeof w->square[3]);
        for (int n = 0; n < LPTN_NB; n++) add_row(U[heated_column[n]], stage->B[n], C[heated_row[n]], 0, LPTN_W);
        for (int n = 0; n < LPTN_NA; n++) add_row(S[slope_column[n]], stage->A[n], D[slope_row[n]], 0, LPTN_NXP);
        for (int j = 0; j < LPTN_NU; j++) U[j][j] += w->R[k][j];
        for (int i = 0; i < LPTN_NX; i++)
            for (int l = i; l < LPTN_NX; l++) U[LPTN_NU + i][LPTN_NU + l] = P[i][l] + S[i][l] + S[l][i];
        if (!eliminate(U)) return 0;
        memcpy(w->U[k], U, sizeof w->U[k]);
        for (int i = 0; i < LPTN_NX; i++)
            for (int l = i; l < LPTN_NX; l++) P[i][l] = P[l][i] = U[LPTN_NU + i][LPTN_NU + l];
    }
    return 1;
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
        /* v = [r + B'F'g, g + A'F'g] */
        const lptn_mpc_stage *stage = &w->stage[k];
        double heat[LPTN_NXP] = {0};
        for (int l = 0; l < LPTN_NX; l++) add_row(heat, g[l], stage->F[l], 0, LPTN_NXP);
        memcpy(v, w->r[k], sizeof w->r[k]), memcpy(v + LPTN_NU, g, sizeof g);
        for (int n = 0; n < LPTN_NB; n++) v[heated_column[n]] += stage->B[n] * heat[heated_row[n]];
        for (int n = 0; n < LPTN_NA; n++) v[LPTN_NU + slope_column[n]] += stage->A[n] * heat[slope_row[n]];
        for (int j = 0; j < LPTN_NU; j++) {
            const double share = v[j] / w->U[k][j][j];
            w->v[k][j] = v[j];
            add_row(v, -share, w->U[k][j], j & ~3, LPTN_W);
        }
        for (int i = 0; i < LPTN_NX; i++) g[i] = v[LPTN_NU + i];
    }
    memset(w->dx[0], 0, sizeof w->dx[0]);
    for (int k = 0; k < LPTN_N; k++) {
        double step[LPTN_W] = {0};
        memcpy(step + LPTN_NU, w->dx[k], sizeof w->dx[k]);
        for (int j = LPTN_NU - 1; j >= 0; j--) step[j] = -(w->v[k][j] + inner(w->U[k][j], step, j & ~3, LPTN_W)) / w->U[k][j][j];
        memcpy(w->ds[k], step, sizeof w->ds[k]);
        double rates[LPTN_NXP] = {0};
        for (int i = 0; i < LPTN_NX; i++) w->dx[k + 1][i] = w->dx[k][i] + w->gap[k][i];
        add_change(&w->stage[k], w->dx[k], w->ds[k], rates, w->dx[k + 1]);
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

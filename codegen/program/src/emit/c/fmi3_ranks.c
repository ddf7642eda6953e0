#ifdef FMU_ROWS
/* Whether gradients of constraints, which a motion keeps independent, have become dependent on the way of a step: the
   motion may go on in more than one way there.
   Rows that go through such a place are turned round: made orthonormal one after the other, as many of them as are
   lost have the opposite direction behind it. A factor that all entries of a row share turns it round and loses
   nothing.
   The steps and numbers are those of hamel_runtime::keeps_rank.
   Deliberately does not know: which model it is, who makes the steps.
   Sources: Gram and Schmidt; Gantmacher, The theory of matrices (1959), chapter I, section 2 (minors along a path). */

typedef double Rows[FMU_ROWS][FMU_STATE];

/* Parts of a step in which rows are followed where its ends say that they have turned; each part is parted again. */
enum { RANK_PARTS = 16, MAX_RANK_PARTS = 256, RANK_DEPTH = 2 };

static double inner(const double *a, const double *b) {
    double sum = 0.0;
    for (int i = 0; i < FMU_STATE; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* Rows of length one, orthogonal to those before them, and zero where they are, as where a mode is off; returns
   the least part of a row that those before it do not have. */
static double orthonormal(double (*rows)[FMU_STATE], Rows q) {
    double least = 1.0;
    for (int k = 0; k < FMU_ROWS; k++) {
        const double own = sqrt(inner(rows[k], rows[k]));
        for (int i = 0; i < FMU_STATE; i++) {
            q[k][i] = own != 0.0 ? rows[k][i] / own : 0.0;
        }
        if (own == 0.0) {
            continue;
        }
        /* Twice, for the digits. */
        for (int j = 0; j < 2 * k; j++) {
            const double part = inner(q[k], q[j % k]);
            for (int i = 0; i < FMU_STATE; i++) {
                q[k][i] -= part * q[j % k][i];
            }
        }
        const double left = sqrt(inner(q[k], q[k]));
        if (!(left > 0.0)) {
            return 0.0;
        }
        least = fmin(least, left);
        for (int i = 0; i < FMU_STATE; i++) {
            q[k][i] /= left;
        }
    }
    return least;
}

/* Whether rows are independent all along the straight line between both: where A B^T + B A^T is positive definite,
   ((1 - s) A + s B) ((1 - s) A + s B)^T is. Rows that are zero at both ends, as where a mode is off, are left out. */
static bool are_near(double (*a)[FMU_STATE], double (*b)[FMU_STATE]) {
    double both[FMU_ROWS][FMU_ROWS];
    for (int i = 0; i < FMU_ROWS; i++) {
        for (int j = 0; j <= i; j++) {
            both[i][j] = 0.5 * (inner(a[i], b[j]) + inner(b[i], a[j]));
        }
    }
    for (int k = 0; k < FMU_ROWS; k++) {
        const double whole = both[k][k];
        if (inner(a[k], a[k]) == 0.0 && inner(b[k], b[k]) == 0.0) {
            both[k][k] = 1.0;
            continue;
        }
        for (int j = 0; j < k; j++) {
            const double factor = both[k][j] / both[j][j];
            for (int i = j + 1; i < k; i++) {
                both[k][i] -= factor * both[i][j];
            }
            both[k][k] -= factor * both[k][j];
        }
        if (!(both[k][k] > 1e-2 * fabs(whole))) {
            return false;
        }
    }
    return true;
}

/* Whether the span of rows turns by more than 60 degrees to another one, or a direction in it turns round. */
static bool are_turned(double (*a)[FMU_STATE], double (*b)[FMU_STATE]) {
    Rows p, q;
    double turn[FMU_ROWS][FMU_ROWS], both[FMU_ROWS][FMU_ROWS], volume = 1.0;
    if (!(orthonormal(a, p) > 0.0 && orthonormal(b, q) > 0.0)) {
        return true;
    }
    for (int i = 0; i < FMU_ROWS; i++) {
        for (int j = 0; j < FMU_ROWS; j++) {
            turn[i][j] = inner(p[i], q[j]);
        }
        turn[i][i] = inner(a[i], a[i]) == 0.0 || inner(b[i], b[i]) == 0.0 ? 1.0 : turn[i][i];
    }
    for (int i = 0; i < FMU_ROWS; i++) {
        for (int j = 0; j < FMU_ROWS; j++) {
            both[i][j] = turn[i][j] + turn[j][i];
        }
    }
    /* Where no direction turns by a right angle, the symmetric part and the whole have positive pivots. */
    for (int k = 0; k < FMU_ROWS; k++) {
        if (!(both[k][k] > 0.0 && turn[k][k] > 0.0)) {
            return true;
        }
        volume *= turn[k][k];
        for (int i = k + 1; i < FMU_ROWS; i++) {
            const double of_both = both[i][k] / both[k][k], of_turn = turn[i][k] / turn[k][k];
            for (int j = k; j < FMU_ROWS; j++) {
                both[i][j] -= of_both * both[k][j];
                turn[i][j] -= of_turn * turn[k][j];
            }
        }
    }
    return !(volume > 0.5);
}

/* Whether row `k` vanishes next to a state: it is shorter than a millionth of its derivative by a component of the
   state, times the size of the state. */
static bool vanishes(const Data *d, double t, const double *y, int k, const double *row) {
    double size = 1.0;
    for (int i = 0; i < FMU_STATE; i++) {
        size = fmax(size, fabs(y[i]));
    }
    for (int j = 0; j < FMU_MOVING; j++) {
        Rows rows;
        double beside[FMU_STATE], change[FMU_STATE];
        memcpy(beside, y, sizeof beside);
        beside[fmu_moving[j]] += 1e-4 * size;
        fmu_rows(&d->prepared, t, beside, rows);
        for (int i = 0; i < FMU_STATE; i++) {
            change[i] = rows[k][i] - row[i];
        }
        if (!(inner(row, row) > 1e-4 * inner(change, change))) {
            return true;
        }
    }
    return false;
}

/* Whether row `k` has one direction all around a state, so that it vanishes with a factor alone. */
static bool has_factor(const Data *d, double t, const double *y, int k) {
    double first[FMU_STATE], beside[FMU_STATE], step = 1.0;
    bool is_known = false;
    for (int i = 0; i < FMU_STATE; i++) {
        step = fmax(step, fabs(y[i]));
    }
    step *= 1e-4;
    for (int i = 0; i < FMU_STATE; i++) {
        step = fmax(step, fabs(y[i] - d->y[i]));
    }
    for (int j = 0; j < 2 * FMU_MOVING; j++) {
        Rows rows;
        memcpy(beside, y, sizeof beside);
        beside[fmu_moving[j / 2]] += j % 2 == 0 ? step : -step;
        fmu_rows(&d->prepared, t, beside, rows);
        const double size = sqrt(inner(rows[k], rows[k]));
        if (size > 0.0 && !is_known) {
            memcpy(first, rows[k], sizeof first);
            is_known = true;
        }
        if (size > 0.0 && !(fabs(inner(first, rows[k])) > 0.9 * size * sqrt(inner(first, first)))) {
            return false;
        }
    }
    return true;
}

/* Whether rows turn on the way from where the motion is to a state next to it, by more than a factor of theirs. */
static bool turn_round(const Data *d, double t, const double *y, double (*before)[FMU_STATE],
                       double (*after)[FMU_STATE]) {
    if (!are_turned(before, after)) {
        return false;
    }
    Rows aligned;
    for (int k = 0; k < FMU_ROWS; k++) {
        const double sign = inner(before[k], after[k]) < 0.0 && has_factor(d, t, y, k) ? -1.0 : 1.0;
        for (int i = 0; i < FMU_STATE; i++) {
            aligned[k][i] = sign * after[k][i];
        }
    }
    return are_turned(before, aligned);
}

/* The state on the cubic from where the motion is to one at a time, with the slopes at both. */
static void on_cubic(const Data *d, double h, double x, const double *end, const double *first, const double *last,
                     double *y) {
    for (int i = 0; i < FMU_STATE; i++) {
        const double difference = end[i] - d->y[i], bend = 2.0 * difference - h * (first[i] + last[i]);
        y[i] = d->y[i] + x * (difference + (1.0 - x) * (h * first[i] - difference + x * bend));
    }
}

/* Whether rows turn round between where the motion is and a state at a time: by small steps of the method, or on the
   cubic between both where these lead elsewhere. */
static bool jump(const Data *d, double t, const double *y, int n_parts, int depth) {
    Data at = *d;
    Rows before, after;
    double next[FMU_STATE], first[FMU_STATE], last[FMU_STATE], way = 0.0, missed = 0.0;
    const double h = t - d->t;
    for (int part = 0; part < n_parts; part++) {
        step(&at, h / n_parts, next, NULL);
        memcpy(at.y, next, sizeof next);
        at.t = d->t + h * (part + 1) / n_parts;
    }
    for (int i = 0; i < FMU_STATE; i++) {
        way = fmax(way, fabs(y[i] - d->y[i]));
        missed = fmax(missed, fabs(y[i] - at.y[i]));
    }
    const bool is_motion = missed <= 0.1 * way;
    fmu_rates(&d->prepared, d->t, d->y, first);
    fmu_rates(&d->prepared, t, y, last);
    at = *d;
    fmu_rows(&at.prepared, at.t, at.y, before);
    for (int part = 1; part <= n_parts; part++) {
        const double time = d->t + h * part / n_parts;
        if (is_motion) {
            step(&at, h / n_parts, next, NULL);
        } else {
            on_cubic(d, h, (double)part / n_parts, y, first, last, next);
        }
        fmu_rows(&at.prepared, time, next, after);
        if (turn_round(&at, time, next, before, after) && (depth == 0 || jump(&at, time, next, RANK_PARTS, depth - 1))) {
            return true;
        }
        memcpy(at.y, next, sizeof next);
        at.t = time;
        memcpy(before, after, sizeof before);
    }
    return false;
}

/* Whether the rank is lost on the way from where the motion is to a state at a time, or there. */
static bool loses_rank(const Data *d, double t, const double *y) {
    Rows before, after, q;
    double farthest = 0.0;
    fmu_rows(&d->prepared, d->t, d->y, before);
    fmu_rows(&d->prepared, t, y, after);
    for (int k = 0; k < FMU_MOVING; k++) {
        farthest = fmax(farthest, fabs(y[fmu_moving[k]] - d->y[fmu_moving[k]]));
    }
    /* An angle that turns a direction round and back does so in many of them. */
    const int n_parts = (int)fmin(farthest / 0.25, MAX_RANK_PARTS);
    for (int k = 0; k < FMU_ROWS; k++) {
        const double length = sqrt(inner(before[k], before[k]));
        if (sqrt(inner(after[k], after[k])) < 0.98 * length && vanishes(d, t, y, k, after[k])) {
            if (!has_factor(d, t, y, k)) {
                return true;
            }
            memcpy(after[k], before[k], sizeof after[k]);
        }
    }
    if (n_parts < 2 && are_near(before, after)) {
        return false;
    }
    /* Reactions are in inverse proportion to it, and have four digits left. */
    if (!(orthonormal(after, q) > 1e-6)) {
        return true;
    }
    if (are_turned(before, after)) {
        return jump(d, t, y, n_parts > RANK_PARTS ? n_parts : RANK_PARTS, RANK_DEPTH - 1);
    }
    return n_parts > 1 && jump(d, t, y, n_parts, RANK_DEPTH - 1);
}
#endif /* FMU_ROWS */

static const char *const passed =
    "equations depend on each other on the way of the last step, as far as the motion has kept them, or a pivot "
    "vanishes there: the equations of motion are singular; a smaller tolerance keeps equations better";

typedef double Gradients[AT_LEAST_ONE(FMU_FUNCTIONS) * AT_LEAST_ONE(FMU_STATE)];
typedef double Squares[AT_LEAST_ONE(FMU_EQUATIONS)];

/* The quotients of successive minors of A B^T: of A A^T, the square of the distance of each row from the span of those
   before it. */
static void minors(const double *a, const double *b, double *quotients) {
    double products[AT_LEAST_ONE(FMU_EQUATIONS)][AT_LEAST_ONE(FMU_EQUATIONS)];
    for (int i = 0; i < FMU_EQUATIONS; i++) {
        for (int j = 0; j < FMU_EQUATIONS; j++) {
            products[i][j] = 0.0;
            for (int k = 0; k < FMU_STATE; k++) {
                products[i][j] += a[i * FMU_STATE + k] * b[j * FMU_STATE + k];
            }
        }
    }
    for (int k = 0; k < FMU_EQUATIONS; k++) {
        quotients[k] = products[k][k];
        for (int i = k + 1; i < FMU_EQUATIONS; i++) {
            const double factor = products[i][k] / products[k][k];
            for (int j = k; j < FMU_EQUATIONS; j++) {
                products[i][j] -= factor * products[k][j];
            }
        }
    }
}

/* Whether the equations at a state are so near to depending on each other that what the motion has lost of them may
   have led it past: at the distance x from the crossing of two branches a gradient is x/L from the span of others, and
   a state that misses an equation by f, in lengths of its gradient, is on a hyperbola with x^2 > 2 L f. L is the length
   on which gradients change. */
static bool is_lost(const Data *d, double t, const double *y) {
    Gradients before, now;
    Squares squares;
    double values[AT_LEAST_ONE(FMU_FUNCTIONS)], missed = 0.0, bend = 0.0, way = 0.0;
    fmu_gradients(&d->prepared, d->t_before, d->y_before, before);
    fmu_gradients(&d->prepared, t, y, now);
    fmu_equations(&d->prepared, t, y, values);
    minors(now, now, squares);
    for (int i = 0; i < FMU_STATE; i++) {
        bool is_position = false;
        for (int k = 0; k < FMU_EQUATIONS; k++) {
            is_position = is_position || before[k * FMU_STATE + i] != 0.0 || now[k * FMU_STATE + i] != 0.0;
        }
        way += is_position ? (y[i] - d->y_before[i]) * (y[i] - d->y_before[i]) : 0.0;
    }
    double least = 1.0;
    for (int k = 0; k < FMU_EQUATIONS; k++) {
        double change = 0.0, size = 0.0;
        for (int i = 0; i < FMU_STATE; i++) {
            const double a = before[k * FMU_STATE + i], b = now[k * FMU_STATE + i];
            change += (b - a) * (b - a);
            size += fmax(a * a, b * b);
        }
        missed = fmax(missed, fabs(values[k]) / sqrt(size));
        bend = fmax(bend, change / size);
        least = fmin(least, squares[k] / size);
    }
    return way > 0.0 && least < 8.0 * missed * sqrt(bend / way);
}

/* Whether rows lose their rank, or a pivot its sign, on the way from the point before to another one, where the motion
   ends if that is final. */
static bool passes(const Data *d, double t, const double *y, bool is_final) {
    const double change =
        fmu_signature(&d->prepared, t, y) - fmu_signature(&d->prepared, d->t_before, d->y_before);
    /* Single divisors have values of their own below one: where the rates have a pole there, no step is accurate. */
    if (!(fabs(change) < 1.0)) {
        return true;
    }
    if (FMU_EQUATIONS > 0 && is_final && is_lost(d, t, y)) {
        return true;
    }
    bool is_passed = false;
#ifdef FMU_ROWS
    Data before = *d;
    before.t = d->t_before;
    memcpy(before.y, d->y_before, sizeof before.y);
    is_passed = loses_rank(&before, t, y);
#endif /* FMU_ROWS */
    return is_passed;
}

/* The motion goes on from where it is. */
static void go_on(Data *d) {
    d->t_before = d->t;
    memcpy(d->y_before, d->y, sizeof d->y);
}

/* What a motion keeps: the residuals of equations at its start, the rank of equations between coordinates, the signs of
   pivots. Behind a place where equations depend on each other a motion may go on in more than one way, and a step over
   it says nothing of which.
   With gradients G, of the first k equations, det G(a) G(b)^T is the product of the determinants of their largest
   minors at two states (Cauchy and Binet). Along a smooth path the vector of these turns as the gradients do; where an
   equation depends on those before it, it passes zero, and is turned round.
   Deliberately does not know: which model it is, the functions of FMI. */

/* The residuals of equations that the state keeps, and which of them is not rounding: larger than 1e-9 of what a change
   of every component by its size, or one, would make of it, as start values come from text, and larger than `allowed`,
   what a motion has lost of it. Negative where all are. */
static int kept(const Data *d, const double *allowed, double *residuals) {
    double values[N_ALL], sizes[AT_LEAST_ONE(FMU_KEPT)] = {0.0};
    evaluate(d, values);
    memcpy(residuals, values + FIRST_OUTPUT + FMU_FIRST_KEPT, FMU_KEPT * sizeof(double));
    for (int i = 0; FMU_KEPT > 0 && i < FMU_STATE; i++) {
        double seeds[N_ALL] = {0.0}, all[N_ALL];
        seeds[FIRST_STATE + i] = fmax(fabs(d->y[i]), 1.0);
        differentiate(d, seeds, all);
        for (int k = 0; k < FMU_KEPT; k++) {
            sizes[k] += fabs(all[FIRST_OUTPUT + FMU_FIRST_KEPT + k]);
        }
    }
    for (int k = 0; k < FMU_KEPT; k++) {
        if (fabs(residuals[k]) > 1e-9 * sizes[k] && fabs(residuals[k]) > 10.0 * allowed[k]) {
            return k;
        }
    }
    return -1;
}

/* Checks and prepares the parameters where they have changed; along a motion they may not break what it keeps. */
static fmi3Status ready(Instance *m) {
    if (!m->data.is_stale) {
        return fmi3OK;
    }
    const bool moves = m->data.mode == EVENT || m->data.mode == CONTINUOUS || m->data.mode == STEP;
    double before[AT_LEAST_ONE(FMU_KEPT)] = {0.0}, after[AT_LEAST_ONE(FMU_KEPT)];
    if (moves) {
        kept(&m->data, before, before);
    }
    const int code = fmu_prepare(m->data.params, &m->data.prepared);
    if (code != 0) {
        return fail(m, fmu_message(code));
    }
    for (int k = 0; k < FMU_KEPT; k++) {
        before[k] = fabs(before[k]);
    }
    const int broken = moves ? kept(&m->data, before, after) : -1;
    if (broken >= 0) {
        return fail(m, fmu_kept_message(broken));
    }
    m->data.is_stale = false;
    return fmi3OK;
}

static const char *const passed =
    "equations depend on each other on the way of the last step, as far as the motion has kept them, or a pivot "
    "vanishes there: the equations of motion are singular; a smaller tolerance keeps equations better";

/* Cosine of an angle by which minors do not turn on a part of a step. */
#define TURNED 0.5

/* Parts of a step in which its way is followed, straight from one state to the other. */
enum { PARTS = 16 };

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

/* Whether the minors of the first equations at one state are far from those at another one. */
static bool is_turned(const Data *d, double t_a, const double *a, double t_b, const double *b) {
    Gradients at_a, at_b;
    Squares along, own, other;
    double cosine = 1.0;
    fmu_gradients(&d->prepared, t_a, a, at_a);
    fmu_gradients(&d->prepared, t_b, b, at_b);
    minors(at_a, at_b, along), minors(at_a, at_a, own), minors(at_b, at_b, other);
    for (int k = 0; k < FMU_EQUATIONS; k++) {
        cosine *= along[k] / sqrt(own[k] * other[k]);
        if (!(cosine >= TURNED)) {
            return true;
        }
    }
    return false;
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

/* Whether the equations lose their rank, or a pivot its sign, on the way from the point before to another one. Where
   the step cannot be made shorter, minors may have turned by much all the same: the way is followed then. */
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
    if (FMU_EQUATIONS == 0 || !is_turned(d, d->t_before, d->y_before, t, y)) {
        return false;
    }
    double from[AT_LEAST_ONE(FMU_STATE)], to[AT_LEAST_ONE(FMU_STATE)], last = d->t_before;
    memcpy(from, d->y_before, sizeof from);
    for (int part = 1; is_final && part <= PARTS; part++) {
        const double s = (double)part / PARTS, time = d->t_before + s * (t - d->t_before);
        for (int i = 0; i < FMU_STATE; i++) {
            to[i] = d->y_before[i] + s * (y[i] - d->y_before[i]);
        }
        if (is_turned(d, last, from, time, to)) {
            return true;
        }
        memcpy(from, to, sizeof from);
        last = time;
    }
    return !is_final;
}

/* The motion goes on from where it is. */
static void go_on(Data *d) {
    d->t_before = d->t;
    memcpy(d->y_before, d->y, sizeof d->y);
}


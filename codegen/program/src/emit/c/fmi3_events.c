/* Co-simulation by the method of Dormand and Prince, through the events of the model; what comes before this text says
   how everything is computed (fmu_..), and what a motion consists of (Data).
   Deliberately does not know: which model it is, the functions of FMI.
   Sources: Dormand and Prince, A family of embedded Runge-Kutta formulae (1980). The events are looked for as
   hamel_runtime does: see Integrator::observe. */

#define EPSILON 2.220446049250313e-16

/* Places in a part of a step at which functions of events are looked at: at distances of no common measure. */
enum { PLACES = 7 };
static const double places[PLACES] = {0.0, 0.0871, 0.2764, 0.4913, 0.7183, 0.9098, 1.0};

typedef double Values[PLACES][AT_LEAST_ONE(FMU_EVENTS)];

/* What the values of a function at the places say: that it is not zero, that it changes its sign once at most, that it
   turns towards zero, or nothing. */
typedef enum { CLEAR, SIMPLE, TURNS, ROUGH } Verdict;

/* Whether a change of sign is one of an event. */
static bool is_change(int event, double before, double now) {
    const int direction = fmu_direction(event);
    return (before > 0.0 && now <= 0.0 && direction <= 0) || (before < 0.0 && now >= 0.0 && direction >= 0);
}

static double noise(const Watch *w) {
    return 64.0 * EPSILON * w->largest;
}

/* What is known of a function that has a value from a change on that was not its own event. */
static void begin(Watch *w, int event, double value) {
    w->value = value;
    w->level = 0.0;
    w->phase = value != 0.0 ? APART : fmu_direction(event) != 0 ? STARTS : DEPARTS;
    w->largest = fmax(w->largest, fabs(value));
}

/* Looks at the functions of events where the motion is now: at the start, and where parameters may have changed. */
static void look_again(Data *d) {
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    fmu_events(&d->prepared, d->t, d->y, now);
    for (int k = 0; k < FMU_EVENTS; k++) {
        if (d->mode == INITIALIZATION || now[k] != d->watch[k].value) {
            begin(&d->watch[k], k, now[k]);
        }
    }
}

/* Goes on with the functions of events from a point without events. */
static void pass(Data *d, const double *now) {
    for (int k = 0; k < FMU_EVENTS; k++) {
        Watch *w = &d->watch[k];
        w->value = now[k];
        w->largest = fmax(w->largest, fabs(now[k]));
        if (now[k] * w->level < 0.0) {
            w->level = 0.0;
        }
    }
}

/* Carries out the events that are due, in their order, each at the state that the one before has left, unless that one
   has moved its function away from zero, to where it came from; `sides` says to which side functions go. Returns
   whether the state has changed; `accumulates` becomes true where an event follows itself within rounding. */
static bool carry_out(Data *d, const bool *due, const double *sides, bool *accumulates) {
    double before[AT_LEAST_ONE(FMU_EVENTS)] = {0.0}, now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    bool fired[AT_LEAST_ONE(FMU_EVENTS)] = {false};
    bool changed = false;
    fmu_events(&d->prepared, d->t, d->y, before);
    memcpy(now, before, sizeof now);
    for (int k = 0; k < FMU_EVENTS; k++) {
        const bool is_there = sides[k] * now[k] >= 0.0 || fabs(now[k]) <= fabs(before[k]) + noise(&d->watch[k]);
        if (!due[k] || (changed && !is_there)) {
            continue;
        }
        const int action = fmu_apply(&d->prepared, k, d->t, d->y);
        fired[k] = true;
        d->has_ended = d->has_ended || (action & 2) != 0;
        if ((action & 1) != 0) {
            changed = true;
            fmu_events(&d->prepared, d->t, d->y, now);
        }
    }
    if (!changed) {
        pass(d, now);
        return false;
    }
    d->since = d->t;
    for (int k = 0; k < FMU_EVENTS; k++) {
        Watch *w = &d->watch[k];
        if (!fired[k]) {
            const bool stays = now[k] == before[k] && now[k] == w->level && w->phase != APART;
            if (!stays) {
                begin(w, k, now[k]);
            }
            continue;
        }
        *accumulates = *accumulates || fabs(d->t - w->last) <= fmax(4096.0 * EPSILON * fabs(d->t), d->shortest);
        w->last = d->t;
        w->value = now[k];
        /* Elsewhere the event has moved the state away from its own zero. */
        const bool is_level = fabs(now[k]) <= fabs(before[k]) + noise(w);
        w->level = is_level ? now[k] : 0.0;
        w->phase = is_level ? RESTARTED : APART;
    }
    return true;
}

/* One step of the method; returns the norm of its error, which is at most 1 where the tolerance is met. The rates at
   both ends go to `slopes` where that is not NULL. */
static double step(const Data *d, double h, double *next, double (*slopes)[AT_LEAST_ONE(FMU_STATE)]) {
    static const double c[7] = {0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0};
    static const double a[7][6] = {
        {0.0},
        {1.0 / 5.0},
        {3.0 / 40.0, 9.0 / 40.0},
        {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
        {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
        {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
        {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0},
    };
    static const double e[7] = {71.0 / 57600.0,      0.0,          -71.0 / 16695.0, 71.0 / 1920.0,
                                -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
    double k[7][AT_LEAST_ONE(FMU_STATE)];
    for (int s = 0; s < 7; s++) {
        for (int i = 0; i < FMU_STATE; i++) {
            double sum = 0.0;
            for (int r = 0; r < s; r++) {
                sum += a[s][r] * k[r][i];
            }
            next[i] = d->y[i] + h * sum;
        }
        fmu_rates(&d->prepared, d->t + c[s] * h, next, k[s]);
    }
    if (slopes) {
        memcpy(slopes[0], k[0], sizeof k[0]);
        memcpy(slopes[1], k[6], sizeof k[6]);
    }
    double norm = 0.0;
    for (int i = 0; i < FMU_STATE; i++) {
        double error = 0.0;
        for (int s = 0; s < 7; s++) {
            error += e[s] * k[s][i];
        }
        const double scale = d->tolerance * (1.0 + fmax(fabs(d->y[i]), fabs(next[i])));
        norm += (h * error / scale) * (h * error / scale);
    }
    return sqrt(norm / AT_LEAST_ONE(FMU_STATE));
}

/* RANKS */

/* The functions of events after a shorter step from where the motion is. */
static void inside(const Data *d, double s, double *now) {
    double y[AT_LEAST_ONE(FMU_STATE)];
    if (s > 0.0) {
        step(d, s, y, NULL);
    } else {
        memcpy(y, d->y, sizeof y);
    }
    fmu_events(&d->prepared, d->t + s, y, now);
}

/* The functions of events in a part of the step, with the values `first` at its start. */
static void look(const Data *d, double from, double to, const double *first, Values values) {
    memcpy(values[0], first, sizeof values[0]);
    for (int j = 1; j < PLACES; j++) {
        inside(d, j + 1 < PLACES ? from + places[j] * (to - from) : to, values[j]);
    }
}

/* The same for the whole step along the cubic between its ends, without further evaluations of the rates. */
static void look_along_cubic(const Data *d, double h, const double *next, double (*slopes)[AT_LEAST_ONE(FMU_STATE)],
                             Values values) {
    for (int j = 0; j < PLACES; j++) {
        const double x = places[j], rest = 1.0 - x;
        double y[AT_LEAST_ONE(FMU_STATE)];
        for (int i = 0; i < FMU_STATE; i++) {
            const double difference = next[i] - d->y[i], first = h * slopes[0][i], last = h * slopes[1][i];
            const double bend = 2.0 * difference - first - last;
            y[i] = d->y[i] + x * (difference + rest * (first - difference + x * bend));
        }
        fmu_events(&d->prepared, d->t + x * h, j + 1 < PLACES ? y : next, values[j]);
    }
}

/* What the values of a function say about it, and where it turns. */
static Verdict judge(const Watch *w, Values values, int k, double *place) {
    double v[PLACES], largest = -HUGE_VAL, least = HUGE_VAL, error = 0.0;
    for (int j = 0; j < PLACES; j++) {
        v[j] = values[j][k] - w->level;
        if (!isfinite(v[j])) {
            return ROUGH;
        }
        largest = fmax(largest, v[j]);
        least = fmin(least, v[j]);
    }
    const double spread = largest - least, distance = fmax(least, -largest);
    /* One that may rest on its level is never out of sight. */
    const Verdict clear = w->phase == APART ? CLEAR : SIMPLE;
    if (distance > 4.0 * spread) {
        return clear;
    }
    if (spread <= noise(w)) {
        return SIMPLE;
    }
    /* From the cubic through every other value. */
    for (int j = 1; j < PLACES; j += 2) {
        double cubic = 0.0;
        for (int a = 0; a < PLACES; a += 2) {
            double weight = 1.0;
            for (int b = 0; b < PLACES; b += 2) {
                weight *= a == b ? 1.0 : (places[j] - places[b]) / (places[a] - places[b]);
            }
            cubic += weight * v[a];
        }
        error = fmax(error, fabs(v[j] - cubic));
    }
    if (error > 0.05 * spread) {
        return ROUGH;
    }
    if (distance > 0.5 * spread) {
        return clear;
    }
    if (distance > 0.0) {
        double lowest = HUGE_VAL;
        for (int j = 1; j + 1 < PLACES; j++) {
            const double a = places[j - 1], b = places[j], c = places[j + 1];
            const double at_a = fabs(v[j - 1]), at_b = fabs(v[j]), at_c = fabs(v[j + 1]);
            const double before = (at_b - at_a) / (b - a), after = (at_c - at_b) / (c - b);
            const double bend = (after - before) / (c - a), slope = before + bend * (b - a);
            const double x = b - 0.5 * slope / bend, y = at_b - 0.25 * slope * slope / bend;
            if (bend > 0.0 && x > a && x < c && y < 0.25 * fmin(at_a, fmin(at_b, at_c)) && y < lowest) {
                lowest = y;
                *place = x;
            }
        }
        return lowest < HUGE_VAL ? TURNS : clear;
    }
    int n_changes = 0;
    double last = 0.0;
    for (int j = 0; j < PLACES; j++) {
        n_changes += v[j] * last < 0.0;
        last = v[j] != 0.0 ? v[j] : last;
    }
    return n_changes > 1 ? ROUGH : SIMPLE;
}

/* Where a function that is on its level at the start of a part has left it by more than rounding; negative if it has
   not. */
static double leaves(const Data *d, int k, double from, double to, double last, double *value) {
    const Watch *w = &d->watch[k];
    const double least = fmin(noise(w), 0.5 * fabs(last - w->level));
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    for (double x = 1.0 / 16777216.0; x < 1.0; x *= 16.0) {
        inside(d, from + x * (to - from), now);
        *value = now[k] - w->level;
        if (fabs(*value) > least) {
            return x;
        }
    }
    *value = last - w->level;
    return *value != 0.0 ? 1.0 : -1.0;
}

/* Whether a function that its own event has left on zero goes on behind it from a rate of zero, as the square of the
   time since then: the event does not hold it. Negative where no two values tell yet. */
static int rests(const Data *d, int k, double from, double to, double last) {
    const Watch *w = &d->watch[k];
    const double before = d->t - w->last, least = noise(w);
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    double s = before + from, value = w->value - w->level;
    for (double x = 1.0 / 16777216.0; x < 1.0 && !(s > 0.0 && fabs(value) > least); x *= 16.0) {
        s = before + from + x * (to - from);
        inside(d, from + x * (to - from), now);
        value = now[k] - w->level;
    }
    if (!(fabs(value) > least)) {
        return -1;
    }
    if (value * w->side < 0.0) {
        return 0;
    }
    const double later = fmin(16.0 * s, before + to), ratio = later / s;
    if (ratio < 2.0) {
        return -1;
    }
    if (later < before + to) {
        inside(d, later - before, now);
        last = now[k];
    }
    const double growth = (last - w->level) / value;
    return growth > 0.0 && growth * growth > pow(ratio, 3.0) && growth * growth < pow(ratio, 5.0);
}

/* Finds the change of sign of a function within a part of the step: how long after its start, or negative; `side` says
   to which side it goes. A function that its own event has left on zero without a rate, and that goes on behind it,
   rests on what does not hold it: its events accumulate. */
static double find(Data *d, int k, double from, double to, Values values, double *side, bool *accumulates) {
    Watch *w = &d->watch[k];
    const double rounding = EPSILON * (to - from + fabs(d->t) + to), length = to - from;
    const double last = values[PLACES - 1][k];
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    double a = 0.0, at_a = w->value - w->level, level = w->level, value;
    const int phase = w->phase;
    const int direction = fmu_direction(k);
    if (phase == STARTS) {
        if (leaves(d, k, from, to, last, &value) < 0.0) {
            return -1.0;
        }
        w->phase = DEPARTS;
        if (value * direction > 0.0) {
            w->phase = APART;
            *side = value;
            return from;
        }
    }
    if (w->phase != APART) {
        const double behind = last - w->level;
        const bool may_end = direction == 0 || behind * direction >= 0.0;
        /* Where has it been in between? */
        for (double x = 4.0 * rounding / length; may_end && x < 1.0; x *= 8.0) {
            inside(d, from + x * length, now);
            if (is_change(k, now[k] - w->level, behind)) {
                const bool is_zero = is_change(k, now[k], last);
                a = x;
                at_a = now[k] - (is_zero ? 0.0 : w->level);
                level = is_zero ? 0.0 : w->level;
                if (is_zero) {
                    break;
                }
            }
        }
        if (a == 0.0) {
            if (phase == RESTARTED && may_end && behind != 0.0) {
                const int is_at_rest = rests(d, k, from, to, last);
                *accumulates = *accumulates || is_at_rest > 0;
                if (is_at_rest < 0) {
                    return -1.0;
                }
            }
            if (behind == 0.0) {
                return -1.0;
            }
        }
        w->phase = APART;
    }
    for (int j = 1; j < PLACES; j++) {
        const double b = places[j], at_b = values[j][k] - level;
        if (b <= a) {
            continue;
        }
        if (!is_change(k, at_a, at_b)) {
            if (at_b != 0.0) {
                a = b;
                at_a = at_b;
            }
            continue;
        }
        *side = at_b - at_a;
        double before = from + a * length, after = from + b * length;
        while (after - before > rounding) {
            const double middle = before + 0.5 * (after - before);
            if (middle <= before || middle >= after) {
                break;
            }
            inside(d, middle, now);
            if (*side > 0.0 ? now[k] - level >= 0.0 : now[k] - level <= 0.0) {
                after = middle;
            } else {
                before = middle;
            }
        }
        return after;
    }
    return -1.0;
}

/* Where around a place of a part a function has the other sign, if it turns there: negative if it has not. */
static double turn(const Data *d, int k, double from, double to, Values values, double place) {
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0};
    int j = 1;
    while (j + 2 < PLACES && places[j] < place) {
        j++;
    }
    const double sign = values[0][k] > 0.0 ? 1.0 : -1.0;
    double x[3] = {places[j - 1], place, places[j + 1 < PLACES ? j + 1 : j]};
    for (int trial = 0; trial < 40; trial++) {
        /* The golden section, as the minimum may be as flat as rounding. */
        const bool is_right_wider = x[2] - x[1] > x[1] - x[0];
        const double wide = x[1] + 0.381966 * (is_right_wider ? x[2] - x[1] : x[0] - x[1]);
        inside(d, from + x[1] * (to - from), now);
        const double at_middle = sign * now[k];
        if (at_middle < 0.0) {
            return from + x[1] * (to - from);
        }
        inside(d, from + wide * (to - from), now);
        const double at_wide = sign * now[k];
        if (at_wide < 0.0) {
            return from + wide * (to - from);
        }
        const bool is_right = wide > x[1];
        if (at_wide < at_middle) {
            x[is_right ? 0 : 2] = x[1];
            x[1] = wide;
        } else {
            x[is_right ? 2 : 0] = wide;
        }
    }
    return -1.0;
}

/* Finds the first events of a step of size `h` that ends at `next`: those of one time, which are `due` after the time
   that is returned, or a negative number. A message where they cannot be followed. */
static double first_events(Data *d, double h, const double *next, double (*slopes)[AT_LEAST_ONE(FMU_STATE)], bool *due,
                           const char **message) {
    Values values;
    bool accumulates = false, is_clear = true;
    double place = 0.0, from = 0.0, to = h, first[AT_LEAST_ONE(FMU_EVENTS)], found[AT_LEAST_ONE(FMU_EVENTS)];
    look_along_cubic(d, h, next, slopes, values);
    for (int k = 0; k < FMU_EVENTS; k++) {
        is_clear = is_clear && judge(&d->watch[k], values, k, &place) == CLEAR;
    }
    if (is_clear) {
        pass(d, values[PLACES - 1]);
        return -1.0;
    }
    const double spacing = EPSILON * (h + fabs(d->t) + h);
    for (int n = 0; n < 1 << 20; n++) {
        for (int k = 0; k < FMU_EVENTS; k++) {
            first[k] = d->watch[k].value;
        }
        look(d, from, to, first, values);
        double shorter = to;
        is_clear = true;
        for (int k = 0; k < FMU_EVENTS; k++) {
            const Verdict verdict = judge(&d->watch[k], values, k, &place);
            is_clear = is_clear && verdict == CLEAR;
            if (verdict == ROUGH && to - from > 64.0 * spacing) {
                shorter = from + 0.5 * (to - from);
                break;
            }
            if (verdict == TURNS) {
                const double there = turn(d, k, from, to, values, place);
                shorter = there > from && there < shorter ? there : shorter;
            }
        }
        if (shorter < to) {
            to = shorter;
            continue;
        }
        double earliest = HUGE_VAL;
        for (int k = 0; k < FMU_EVENTS; k++) {
            found[k] = is_clear ? -1.0 : find(d, k, from, to, values, &d->watch[k].side, &accumulates);
            earliest = found[k] >= 0.0 ? fmin(earliest, found[k]) : earliest;
        }
        if (accumulates) {
            *message = "events accumulate: one changes the state again within the rounding of time, or leaves it at "
                       "rest where nothing holds it; let it end the motion";
            return -1.0;
        }
        if (earliest < HUGE_VAL) {
            double now[AT_LEAST_ONE(FMU_EVENTS)], latest = earliest;
            inside(d, earliest, now);
            for (int k = 0; k < FMU_EVENTS; k++) {
                const double distance = found[k] - earliest;
                const bool is_near = distance <= 4096.0 * spacing;
                const bool is_zero = fabs(now[k]) <= noise(&d->watch[k]);
                due[k] = found[k] >= 0.0
                         && (distance <= 4.0 * spacing || (is_near && is_zero) || now[k] * d->watch[k].side > 0.0);
                latest = due[k] && is_near ? fmax(latest, found[k]) : latest;
            }
            return latest;
        }
        pass(d, values[PLACES - 1]);
        if (to >= h) {
            return -1.0;
        }
        const double longer = 4.0 * (to - from);
        from = to;
        to = longer >= h - from ? h : from + longer;
    }
    *message = "a function of an event changes too often: let communication steps be shorter";
    return -1.0;
}

/* Carries out the conditions that inputs or parameters have made true since the last point; false where events
   accumulate. */
static bool follow_conditions(Data *d) {
    double now[AT_LEAST_ONE(FMU_EVENTS)] = {0.0}, sides[AT_LEAST_ONE(FMU_EVENTS)];
    bool due[AT_LEAST_ONE(FMU_EVENTS)] = {false}, is_due = false, accumulates = false;
    fmu_events(&d->prepared, d->t, d->y, now);
    for (int k = 0; k < FMU_EVENTS; k++) {
        sides[k] = -1.0;
        due[k] = fmu_is_condition(k) && d->watch[k].value >= 0.0 && now[k] < 0.0;
        is_due = is_due || due[k];
    }
    if (is_due) {
        carry_out(d, due, sides, &accumulates);
    }
    return !accumulates;
}

/* After so many steps, each shortened before a place where equations depend on each other, the motion ends. */
enum { MOST_PASSED = 40 };

/* Moves on to a time, or to the end of the motion. */
static fmi3Status advance(Instance *m, double end) {
    Data *d = &m->data;
    double next[AT_LEAST_ONE(FMU_STATE)], slopes[2][AT_LEAST_ONE(FMU_STATE)];
    if (!follow_conditions(d)) {
        return fail(m, "events accumulate: one changes the state again within the rounding of time; let it end the "
                       "motion");
    }
    look_again(d);
    go_on(d);
    /* The end of the first step that led over such a place, and how many shorter ones have done so since. */
    double until = d->t;
    int n_passed = 0;
    /* Nobody lives to see the end of what happens more often. */
    d->shortest = 16.0 * EPSILON * fabs(end - d->t);
    while (d->t < end && !d->has_ended) {
        const double rest = end - d->t;
        const double least = 16.0 * EPSILON * fmax(fabs(d->t), fabs(end));
        if (!(d->h > 0.0)) {
            d->h = fmin(rest, 1e-3);
        }
        /* The last step lands on the end, and leaves no sliver behind. */
        const bool is_last = d->h >= rest || rest - d->h < least;
        const double h = is_last ? rest : d->h;
        const double error = step(d, h, next, slopes);
        if (!(error <= 1.0) || fmu_domain(&d->prepared, d->t + h, next) != 0) {
            const double shorter = error > 1.0 ? fmax(0.2, 0.9 * pow(error, -0.2)) : 0.2;
            d->h = h * shorter;
            if (d->h < least) {
                const int code = fmu_check(&d->prepared, d->t, d->y);
                const int outside = fmu_domain(&d->prepared, d->t + h, next);
                return fail(m, code != 0 ? fmu_message(code)
                                         : outside != 0 ? fmu_message(outside)
                                                        : "the steps of the method become too short");
            }
            continue;
        }
        if (passes(d, d->t + h, next, false)) {
            n_passed = d->t < until ? n_passed + 1 : 0;
            until = d->t < until ? until : d->t + h;
            d->h = 0.2 * h;
            if (n_passed > MOST_PASSED || d->h < least) {
                return fail(m, passed);
            }
            continue;
        }
        if (FMU_EQUATIONS > 0 && is_lost(d, d->t + h, next)) {
            return fail(m, passed);
        }
        const double longer = h * fmin(5.0, 0.9 * pow(fmax(error, 1e-10), -0.2));
        bool due[AT_LEAST_ONE(FMU_EVENTS)] = {false};
        const char *message = NULL;
        const double at = FMU_EVENTS > 0 ? first_events(d, h, next, slopes, due, &message) : -1.0;
        if (message) {
            return fail(m, message);
        }
        d->h = is_last && longer < d->h ? d->h : longer;
        if (at < 0.0) {
            d->t = is_last ? end : d->t + h;
            memcpy(d->y, next, sizeof next);
            go_on(d);
            continue;
        }
        if (at > 0.0) {
            step(d, at, next, NULL);
            memcpy(d->y, next, sizeof next);
            d->t = is_last && at >= h ? end : d->t + at;
        }
        double sides[AT_LEAST_ONE(FMU_EVENTS)];
        for (int k = 0; k < FMU_EVENTS; k++) {
            sides[k] = d->watch[k].side;
        }
        const double since = d->t - d->since;
        bool accumulates = false;
        if (carry_out(d, due, sides, &accumulates)) {
            /* The motion until now says how soon the next event may be. */
            d->h = fmin(d->h, fmax(since, 1e4 * EPSILON * fabs(d->t)));
        }
        if (accumulates) {
            return fail(m, "events accumulate: one changes the state again within the rounding of time; let it end "
                           "the motion");
        }
        go_on(d);
    }
    return fmi3OK;
}

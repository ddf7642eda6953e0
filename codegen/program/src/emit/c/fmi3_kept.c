/* The equations that a motion keeps: their residuals at its start, and where parameters change on its way.
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

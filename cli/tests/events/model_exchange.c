/* Moves an FMU by model exchange, as an importer with fixed steps of Runge and Kutta's method does: the token, the time
   to reach, the step, the number of states, that of event indicators. Prints "failed: .." or "reached", the time, and
   the states. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Log)(void *, int, const char *, const char *);

void *fmi3InstantiateModelExchange(const char *, const char *, const char *, bool, bool, void *, Log);
int fmi3EnterInitializationMode(void *, bool, double, double, bool, double);
int fmi3ExitInitializationMode(void *);
int fmi3EnterEventMode(void *);
int fmi3UpdateDiscreteStates(void *, bool *, bool *, bool *, bool *, bool *, double *);
int fmi3EnterContinuousTimeMode(void *);
int fmi3CompletedIntegratorStep(void *, bool, bool *, bool *);
int fmi3SetTime(void *, double);
int fmi3SetContinuousStates(void *, const double *, size_t);
int fmi3GetContinuousStates(void *, double *, size_t);
int fmi3GetContinuousStateDerivatives(void *, double *, size_t);
int fmi3GetEventIndicators(void *, double *, size_t);
void fmi3FreeInstance(void *);

enum { MOST = 32 };

static void *fmu;
static size_t n_states, n_events;

static void tell(void *environment, int status, const char *category, const char *message) {
    (void)environment, (void)status, (void)category;
    printf("failed: %s\n", message);
}

static void rates(double t, const double *y, double *slopes) {
    fmi3SetTime(fmu, t);
    fmi3SetContinuousStates(fmu, y, n_states);
    fmi3GetContinuousStateDerivatives(fmu, slopes, n_states);
}

/* Goes from a state by a step, and has the indicators there. */
static void go(double t, const double *y, double h, double *next, double *indicators) {
    static const double part[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    double slope[MOST] = {0.0}, at[MOST], sum[MOST] = {0.0};
    for (int k = 0; k < 4; k++) {
        for (size_t i = 0; i < n_states; i++) {
            at[i] = y[i] + part[k] * h * slope[i];
        }
        rates(t + part[k] * h, at, slope);
        for (size_t i = 0; i < n_states; i++) {
            sum[i] += weight[k] * slope[i];
        }
    }
    for (size_t i = 0; i < n_states; i++) {
        next[i] = y[i] + h * sum[i];
    }
    fmi3SetTime(fmu, t + h);
    fmi3SetContinuousStates(fmu, next, n_states);
    fmi3GetEventIndicators(fmu, indicators, n_events);
}

static bool is_changed(const double *before, const double *after) {
    for (size_t k = 0; k < n_events; k++) {
        if ((before[k] > 0.0) != (after[k] > 0.0)) {
            return true;
        }
    }
    return false;
}

int main(int n, char **arguments) {
    if (n != 6) {
        return 1;
    }
    const double end = atof(arguments[2]), size = atof(arguments[3]);
    n_states = (size_t)atoi(arguments[4]), n_events = (size_t)atoi(arguments[5]);
    fmu = fmi3InstantiateModelExchange("one", arguments[1], "", false, false, NULL, tell);
    if (!fmu || n_states > MOST || n_events > MOST || fmi3EnterInitializationMode(fmu, false, 0.0, 0.0, false, 0.0) != 0
        || fmi3ExitInitializationMode(fmu) != 0) {
        return 1;
    }
    double t = 0.0, y[MOST], next[MOST], before[MOST], after[MOST], scratch;
    bool update = true, ended = false, other, changed, defined, is_event = true;
    int status = 0;
    while (status == 0 && !ended && (is_event || t < end)) {
        if (is_event) {
            update = true;
            while (status == 0 && update && !ended) {
                status = fmi3UpdateDiscreteStates(fmu, &update, &ended, &other, &changed, &defined, &scratch);
            }
            fmi3EnterContinuousTimeMode(fmu);
            fmi3GetContinuousStates(fmu, y, n_states);
            fmi3GetEventIndicators(fmu, before, n_events);
            is_event = false;
            continue;
        }
        double h = end - t < size * (1.0 + 1e-9) ? end - t : size;
        go(t, y, h, next, after);
        if (is_changed(before, after)) {
            double low = 0.0, high = h;
            for (int k = 0; k < 60; k++) {
                const double middle = (low + high) / 2.0;
                go(t, y, middle, next, after);
                *(is_changed(before, after) ? &high : &low) = middle;
            }
            h = high;
            go(t, y, h, next, after);
            is_event = true;
        }
        t += h;
        memcpy(y, next, sizeof y);
        memcpy(before, after, sizeof before);
        bool asked = false;
        status = fmi3CompletedIntegratorStep(fmu, true, &asked, &ended);
        is_event = is_event || asked;
        if (is_event) {
            fmi3EnterEventMode(fmu);
        }
    }
    printf("%s\n%.17g\n", status != 0 ? "stopped" : ended ? "ended" : "reached", t);
    for (size_t k = 0; k < n_states; k++) {
        printf("%.17g\n", y[k]);
    }
    fmi3FreeInstance(fmu);
    return 0;
}

/* Moves an FMU: the token, the time to reach, the size of steps, the number of states, and whether it integrates
   "itself", by co-simulation, or the "importer" does, by Runge and Kutta's method. Prints "failed: .." where something
   failed, how the motion has ended, the time, and the states. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Log)(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                  size_t, void *, Log, void *);
void *fmi3InstantiateModelExchange(const char *, const char *, const char *, bool, bool, void *, Log);
int fmi3EnterInitializationMode(void *, bool, double, double, bool, double);
int fmi3ExitInitializationMode(void *);
int fmi3EnterContinuousTimeMode(void *);
int fmi3SetTime(void *, double);
int fmi3SetContinuousStates(void *, const double *, size_t);
int fmi3GetContinuousStates(void *, double *, size_t);
int fmi3GetContinuousStateDerivatives(void *, double *, size_t);
int fmi3CompletedIntegratorStep(void *, bool, bool *, bool *);
int fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);
int fmi3GetFloat64(void *, const uint32_t *, size_t, double *, size_t);
void fmi3FreeInstance(void *);

enum { MOST = 256 };

static void tell(void *environment, int status, const char *category, const char *message) {
    (void)environment, (void)status, (void)category;
    printf("failed: %s\n", message);
}

/* A step of Runge and Kutta's method, without events. */
static int classical(void *fmu, size_t n, double size, double *t) {
    static const double places[4] = {0.0, 0.5, 0.5, 1.0}, weights[4] = {1.0, 2.0, 2.0, 1.0};
    double y[MOST], sum[MOST] = {0.0}, k[MOST] = {0.0}, moved[MOST];
    bool event = false, ended = false;
    int status = fmi3GetContinuousStates(fmu, y, n);
    for (int s = 0; s < 4; s++) {
        for (size_t i = 0; i < n; i++) {
            moved[i] = y[i] + places[s] * size * k[i];
        }
        status |= fmi3SetTime(fmu, *t + places[s] * size) | fmi3SetContinuousStates(fmu, moved, n);
        status |= fmi3GetContinuousStateDerivatives(fmu, k, n);
        for (size_t i = 0; i < n; i++) {
            sum[i] += weights[s] * k[i] / 6.0;
        }
    }
    for (size_t i = 0; i < n; i++) {
        moved[i] = y[i] + size * sum[i];
    }
    *t += size;
    status |= fmi3SetTime(fmu, *t) | fmi3SetContinuousStates(fmu, moved, n);
    return status | fmi3CompletedIntegratorStep(fmu, true, &event, &ended);
}

int main(int n, char **arguments) {
    if (n != 6) {
        return 1;
    }
    const char *token = arguments[1];
    const double end = atof(arguments[2]), size = atof(arguments[3]);
    const size_t n_states = (size_t)atoi(arguments[4]);
    const bool is_alone = strcmp(arguments[5], "itself") == 0;
    void *fmu = is_alone ? fmi3InstantiateCoSimulation("one", token, "", false, false, false, false, NULL, 0, NULL, tell, NULL)
                         : fmi3InstantiateModelExchange("one", token, "", false, false, NULL, tell);
    if (n_states > MOST || !fmu || fmi3EnterInitializationMode(fmu, true, 1e-11, 0.0, false, 0.0) != 0
        || fmi3ExitInitializationMode(fmu) != 0 || (!is_alone && fmi3EnterContinuousTimeMode(fmu) != 0)) {
        return 1;
    }
    double t = 0.0;
    bool event = false, ended = false, early = false;
    int status = 0;
    while (status == 0 && !ended && t < end) {
        const double rest = end - t, next = rest < size * (1.0 + 1e-9) ? rest : size;
        status = is_alone ? fmi3DoStep(fmu, t, next, false, &event, &ended, &early, &t)
                          : classical(fmu, n_states, next, &t);
    }
    printf("%s\n%.17g\n", status != 0 ? "stopped" : ended ? "ended" : "reached", t);
    for (uint32_t k = 1; k <= (uint32_t)n_states; k++) {
        double value = 0.0;
        if (fmi3GetFloat64(fmu, &k, 1, &value, 1) != 0) {
            return 1;
        }
        printf("%.17g\n", value);
    }
    fmi3FreeInstance(fmu);
    return 0;
}

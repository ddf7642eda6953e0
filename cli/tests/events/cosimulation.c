/* Moves an FMU by co-simulation: the token, the time to reach, the communication step, the number of states; then
   variables that are set before it, each as a reference and a value, and behind "--" variables that are set after the
   first step. Prints "failed: .." or "reached", the time, and the states. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Log)(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                  size_t, void *, Log, void *);
int fmi3EnterInitializationMode(void *, bool, double, double, bool, double);
int fmi3ExitInitializationMode(void *);
int fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);
int fmi3GetFloat64(void *, const uint32_t *, size_t, double *, size_t);
int fmi3SetFloat64(void *, const uint32_t *, size_t, const double *, size_t);
void fmi3FreeInstance(void *);

static void tell(void *environment, int status, const char *category, const char *message) {
    (void)environment, (void)status, (void)category;
    printf("failed: %s\n", message);
}

/* Sets variables by the arguments from a place on; the place behind them. */
static int set(void *fmu, int n, char **arguments, int from) {
    while (from + 1 < n && strcmp(arguments[from], "--") != 0) {
        const uint32_t reference = (uint32_t)atoi(arguments[from]);
        const double value = atof(arguments[from + 1]);
        fmi3SetFloat64(fmu, &reference, 1, &value, 1);
        from += 2;
    }
    return from + 1;
}

int main(int n, char **arguments) {
    if (n < 5) {
        return 1;
    }
    const double end = atof(arguments[2]), size = atof(arguments[3]);
    void *fmu = fmi3InstantiateCoSimulation("one", arguments[1], "", false, false, false, false, NULL, 0, NULL, tell, NULL);
    if (!fmu) {
        return 1;
    }
    int later = set(fmu, n, arguments, 5);
    if (fmi3EnterInitializationMode(fmu, true, 1e-11, 0.0, false, 0.0) != 0
        || fmi3ExitInitializationMode(fmu) != 0) {
        printf("stopped\n0\n");
        return 0;
    }
    double t = 0.0;
    bool event = false, ended = false, early = false;
    int status = 0;
    while (status == 0 && !ended && t < end) {
        const double rest = end - t;
        status = fmi3DoStep(fmu, t, rest < size * (1.0 + 1e-9) ? rest : size, false, &event, &ended, &early, &t);
        later = set(fmu, n, arguments, later);
    }
    printf("%s\n%.17g\n", status != 0 ? "stopped" : ended ? "ended" : "reached", t);
    for (uint32_t k = 1; k <= (uint32_t)atoi(arguments[4]); k++) {
        double value = 0.0;
        if (fmi3GetFloat64(fmu, &k, 1, &value, 1) != 0) {
            return 1;
        }
        printf("%.17g\n", value);
    }
    fmi3FreeInstance(fmu);
    return 0;
}
